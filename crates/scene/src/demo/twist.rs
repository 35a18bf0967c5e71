//! `demo:twist`: a striped cloth between two bars is twisted by almost four turns.

use super::noise;
use super::shapes::{capsule, sheet, sheet_size};
use super::stage::{DemoPart, blend, rotation, shade, smoothstep};
use crate::Rgb;
use glam::{DAffine3, DVec3};
use std::f64::consts::TAU;

/// Turns of one bar relative to the other at a progress of 1. The animation ends at 0.94.
const TURNS: f64 = 4.0;
/// Half the length and half the width of the cloth.
const HALF: [f64; 2] = [1.6, 0.85];
const HEIGHT: f64 = 1.25;
const STRIPES: [Rgb; 4] = [
    [236, 229, 212],
    [196, 62, 62],
    [236, 229, 212],
    [42, 74, 122],
];
const WOOD: Rgb = [150, 106, 66];
const FLOOR: Rgb = [206, 208, 204];

/// Builds about `budget` triangles: the cloth, a floor, and two bars if the budget is large enough.
pub(super) fn build(budget: usize) -> Vec<DemoPart> {
    let bar = budget / 50;
    let mut parts = vec![DemoPart::floor(bar.max(2), [6.0, 4.0], FLOOR, |p| {
        noise(64, p * 2.0)
    })];
    if bar >= 6 {
        parts.extend([-1.0, 1.0].map(|side| clamp_bar(bar, side)));
    }
    let used: usize = parts.iter().map(DemoPart::len).sum();
    parts.insert(0, cloth(budget.saturating_sub(used).max(2)));
    parts
}

fn cloth(budget: usize) -> DemoPart {
    let mesh = sheet(sheet_size(budget, HALF[0] / HALF[1]), |u, v| {
        DVec3::new((2.0 * u - 1.0) * HALF[0], (1.0 - 2.0 * v) * HALF[1], 0.0)
    });
    DemoPart::new(mesh, weave, |time| {
        let wrung = wrung(time);
        move |p| wring(p, wrung)
    })
}

fn weave(p: DVec3) -> Rgb {
    let band = libm::floor((p.y / HALF[1] + 1.0) * 6.0) as usize % STRIPES.len();
    let thread = 0.05 * noise(61, p * DVec3::new(3.0, 60.0, 1.0));
    let grime = 0.06 * (1.0 + noise(62, p * 40.0));
    blend(shade(STRIPES[band], thread), [60, 50, 60], grime)
}

/// Returns the progress of the twist, from 0 at the start to 0.94 at the end.
fn wrung(time: f64) -> f64 {
    (smoothstep(-0.15, 1.1, time) - smoothstep(-0.15, 1.1, 0.0)).max(0.0)
}

/// Returns half the distance between the bars. The cloth shortens while it is twisted.
fn half_length(wrung: f64) -> f64 {
    HALF[0] * (1.0 - 0.16 * wrung * wrung)
}

/// Returns the rotation of the cross-section at `along`, which is in `-1.0..=1.0`.
fn turn(along: f64, wrung: f64) -> f64 {
    0.5 * TURNS * TAU * wrung * along
}

/// Rotates each cross-section relative to the next, and contracts, rolls up and wrinkles the middle.
fn wring(p: DVec3, wrung: f64) -> DVec3 {
    let (along, across) = (p.x / HALF[0], p.y / HALF[1]);
    let free = 1.0 - along * along;
    let tight = smoothstep(0.0, 0.7, wrung) * free.sqrt();
    let reach = across * HALF[1] * (1.0 - 0.72 * tight);
    let roll = 1.9 * tight * across.abs();
    let fold = libm::sin(21.0 * across + 5.0 * along) * 0.018
        + libm::sin(9.0 * across - 11.0 * along) * 0.022;
    let depth = (fold * smoothstep(0.0, 0.25, wrung)
        + 0.05 * libm::sin(4.0 * along + 2.0 * across) * (1.0 - wrung))
        * free;
    let angle = turn(along, wrung) + roll;
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let sag = 0.06 * free * (1.0 - 0.6 * wrung);
    DVec3::new(
        along * half_length(wrung),
        HEIGHT - sag + reach * cos - depth * sin,
        reach * sin + depth * cos,
    )
}

/// Returns a closed bar along one end of the cloth, which rotates with it.
fn clamp_bar(budget: usize, side: f64) -> DemoPart {
    let length = 2.0 * HALF[1] + 0.1;
    let bar = capsule(budget, length, [0.045, 0.045]);
    let mesh = bar.map(|p| p + DVec3::Y * 0.5 * length);
    let grain = |p: DVec3| shade(WOOD, 0.15 * noise(63, p * DVec3::new(30.0, 6.0, 30.0)));
    DemoPart::rigid(mesh, grain, move |time| {
        let wrung = wrung(time);
        let place = DVec3::new(side * half_length(wrung), HEIGHT, 0.0);
        DAffine3::from_mat3_translation(rotation(DVec3::X, turn(side, wrung)), place)
    })
}
