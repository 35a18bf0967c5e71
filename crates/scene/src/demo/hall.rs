//! `demo:hall`: a static hall of columns, and a small figure that walks through it.

use super::figure::{Stride, figure};
use super::shapes::{cube, cube_cuts, revolve, revolve_size, sheet, sheet_size};
use super::stage::{DemoPart, shade, smoothstep};
use super::{noise, unit};
use crate::Rgb;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Half the length and half the width of the floor, in metres.
const HALF: [f64; 2] = [6.4, 3.2];
/// Height of the columns, and height of the wall behind them.
const HEIGHT: [f64; 2] = [4.0, 5.0];
/// Number of columns per row.
const COLUMNS: u32 = 6;
/// z coordinates of the two rows of columns.
const ROWS: [f64; 2] = [-2.0, 2.0];
/// Side length of a floor tile.
const TILE: f64 = 0.8;
const STONE: Rgb = [206, 198, 182];
const PLASTER: Rgb = [190, 172, 150];
const TILES: [Rgb; 2] = [[150, 120, 98], [196, 178, 150]];

/// Builds about `budget` triangles: 1/20 figure, 1/6 floor, 1/5 wall, 1/10 beams, and the rest columns.
pub(super) fn build(budget: usize) -> Vec<DemoPart> {
    let mut parts = vec![floor((budget / 6).max(2))];
    parts.extend(figure(budget / 20, walk));
    let wall_share = budget / 5;
    if wall_share >= 2 {
        parts.push(wall(wall_share));
    }
    let beam_share = budget / 20;
    if beam_share >= 12 {
        parts.extend(ROWS.map(|z| beam(beam_share, z)));
    }
    let used: usize = parts.iter().map(DemoPart::len).sum();
    let share = budget.saturating_sub(used) / (ROWS.len() * COLUMNS as usize);
    if share >= 20 {
        let places = (0..COLUMNS).flat_map(|i| ROWS.map(|z| DVec3::new(along(i), 0.0, z)));
        parts.extend(places.map(|place| column(share, place)));
    }
    parts
}

fn walk(time: f64) -> Stride {
    Stride {
        ground: DVec3::new(-4.4 + 8.8 * time, 0.0, 0.25),
        phase: 6.0 * time + 0.1,
    }
}

/// Returns the x coordinate of column `i` of a row.
fn along(i: u32) -> f64 {
    let step = f64::from(i) / f64::from(COLUMNS - 1);
    (2.0 * step - 1.0) * (HALF[0] - 0.8)
}

/// Returns 1 at the joint between two tiles, falling to 0 away from it.
fn joint(x: f64) -> f64 {
    let from_middle = (x / TILE - libm::floor(x / TILE) - 0.5).abs();
    smoothstep(0.46, 0.5, from_middle)
}

fn floor(budget: usize) -> DemoPart {
    let size = sheet_size(budget, HALF[0] / HALF[1]);
    // Uses a whole number of squares per tile if the budget allows.
    let tiles = HALF.map(|half| libm::round(2.0 * half / TILE) as u32);
    let size = [0, 1].map(|i| match size[i] / tiles[i] {
        0 => size[i],
        squares => squares * tiles[i],
    });
    let mesh = sheet(size, |u, v| {
        let (x, z) = ((2.0 * u - 1.0) * HALF[0], (2.0 * v - 1.0) * HALF[1]);
        DVec3::new(x, -0.015 * joint(x).max(joint(z)), z)
    });
    DemoPart::still(mesh, |p| {
        let [i, j] = [p.x, p.z].map(|x| libm::floor(x / TILE) as i64);
        let tile = ((i + 64) * 128 + j + 64) as u64;
        let base = TILES[((i + j) & 1) as usize];
        let lighter = 0.16 * (unit(201, tile) - 0.5);
        shade(base, lighter + 0.06 * noise(202, p * 6.0))
    })
}

/// Creates a wall along x with an arched niche behind each gap between columns.
fn wall(budget: usize) -> DemoPart {
    let mesh = sheet(sheet_size(budget, 2.0 * HALF[0] / HEIGHT[1]), |u, v| {
        let (x, y) = ((2.0 * u - 1.0) * HALF[0], (1.0 - v) * HEIGHT[1]);
        DVec3::new(x, y, -HALF[1] - 0.35 * niche(x, y))
    });
    DemoPart::still(mesh, |p| {
        let stain = 0.12 * noise(203, p * 1.7) + 0.05 * noise(204, p * 11.0);
        shade(PLASTER, stain - 0.2 * niche(p.x, p.y))
    })
}

/// Returns the relative depth of the niches: 1 inside, 0 outside.
fn niche(x: f64, y: f64) -> f64 {
    let step = along(1) - along(0);
    let place = (x - along(0)) / step;
    if !(0.0..f64::from(COLUMNS - 1)).contains(&place) {
        return 0.0;
    }
    let across = (place - libm::floor(place) - 0.5) * step;
    let up = (y - 2.6).max(0.0);
    let sill = smoothstep(0.7, 0.76, y);
    let inside = 1.0 - smoothstep(0.62, 0.68, DVec2::new(across, up).length());
    sill * inside
}

fn beam(budget: usize, z: f64) -> DemoPart {
    let half = DVec3::new(HALF[0], 0.22, 0.3);
    let middle = DVec3::new(0.0, HEIGHT[0] + half.y, z);
    let mesh = cube(cube_cuts(budget)).map(|p| {
        let swell = 1.0 + 0.12 * smoothstep(0.6, 0.75, p.y);
        middle + p * half * DVec3::new(1.0, 1.0, swell)
    });
    DemoPart::still(mesh, |p| shade(STONE, 0.1 * noise(205, p * 3.0) - 0.04))
}

/// Creates a fluted column with a round base and a capital.
fn column(budget: usize, place: DVec3) -> DemoPart {
    let mesh = revolve(revolve_size(budget, 1.0), |v| {
        let y = HEIGHT[0] * (1.0 - v);
        let base = 0.14 * (1.0 - smoothstep(0.12, 0.34, y));
        let capital = 0.16 * smoothstep(HEIGHT[0] - 0.5, HEIGHT[0] - 0.06, y);
        let shaft = 0.27 - 0.05 * y / HEIGHT[0];
        DVec2::new(shaft + base + capital, y)
    });
    let fluted = mesh.map(|p| {
        let shaft = smoothstep(0.3, 0.5, p.y) * (1.0 - smoothstep(3.3, 3.5, p.y));
        let turn = libm::atan2(p.z, p.x) / TAU;
        let flute = 1.0 - 0.07 * shaft * libm::sin(6.0 * TAU * turn).abs();
        place + p * DVec3::new(flute, 1.0, flute)
    });
    DemoPart::still(fluted, |p| {
        let stain = 0.1 * noise(206, p * 2.3) + 0.06 * noise(207, p * 14.0);
        shade(STONE, stain)
    })
}
