//! `demo:shatter`: a ball breaks into thousands of pieces that fly, tumble, bounce and mix.
//!
//! Neighbouring pieces separate at random speeds, so a tree that is built for the intact ball soon becomes inefficient.

use super::shapes::{DemoMesh, cube, onto_ball};
use super::stage::{DemoPart, Trajectory, blend, shade};
use super::{between, direction, noise};
use crate::Rgb;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Default number of triangles.
pub(super) const TRIANGLES: usize = 1_600_000;
const SECONDS: f64 = 1.7;
const RADIUS: f64 = 1.2;
const CENTRE: DVec3 = DVec3::new(0.0, 1.25, 0.0);
const CRUST: Rgb = [38, 112, 140];
const RIND: Rgb = [232, 93, 58];
const CORE: Rgb = [255, 205, 96];
const FLOOR: Rgb = [214, 208, 198];

/// Builds about `budget` triangles: `cells^3` pieces and a floor.
pub(super) fn build(budget: usize) -> Vec<DemoPart> {
    let floor = DemoPart::floor((budget / 100).max(2), [13.0, 13.0], FLOOR, |p| {
        noise(51, p * 1.5)
    });
    let budget = budget.saturating_sub(floor.len());
    let cells = cells_along(budget);
    let pieces = u64::from(cells).pow(3);
    let mut parts: Vec<DemoPart> = (0..pieces)
        .into_par_iter()
        .map(|piece| shard(piece, cells, cuts_of(piece, pieces, budget as u64)))
        .collect();
    parts.push(floor);
    parts
}

/// Returns the number of cells along an edge of the lattice. The default budget gives 16 (4096 pieces). Larger budgets
/// increase both the number and the detail of the pieces.
fn cells_along(budget: usize) -> u32 {
    let ideal = 16.0 * libm::pow(budget as f64 / TRIANGLES as f64, 2.0 / 9.0);
    let most = libm::floor(libm::cbrt(budget as f64 / 12.0));
    libm::round(ideal).min(most).max(1.0) as u32
}

/// Returns the number of squares along a piece's edge: one of two successive numbers. They are mixed so that all
/// pieces together meet the budget.
fn cuts_of(piece: u64, pieces: u64, budget: u64) -> u32 {
    let small = (budget / (12 * pieces)).isqrt().max(1);
    let missing = budget.saturating_sub(12 * pieces * small * small);
    let large = (missing / (12 * (2 * small + 1))).min(pieces);
    // Piece `i` is large if the integer `(i + 1) * large / pieces` exceeds `i * large / pieces`. This spaces the large
    // pieces evenly.
    let rises = (piece + 1) * large / pieces > piece * large / pieces;
    (small + u64::from(rises)) as u32
}

/// Creates one closed piece: a cell of the cube's lattice, deformed by [`bend`] and mapped to the ball. [`bend`] maps
/// a point of the common face of two cells to the same position in both.
fn shard(piece: u64, cells: u32, cuts: u32) -> DemoPart {
    let n = u64::from(cells);
    let cell = DVec3::new(
        (piece % n) as f64,
        (piece / n % n) as f64,
        (piece / (n * n)) as f64,
    );
    let size = 2.0 / f64::from(cells);
    let into_cube = |p: DVec3| (cell + (p + 1.0) * 0.5) * size - 1.0;
    let mesh = cube(cuts).map(|p| RADIUS * onto_ball(bend(into_cube(p), size)));
    let middle = mesh.points.iter().sum::<DVec3>() / mesh.points.len() as f64;
    let trajectory = throw(piece, middle);
    let tint = between(11, piece, [-0.12, 0.12]);
    let colour = move |p: DVec3| shade(colour_at(p + middle), tint);
    let mesh = DemoMesh::map(mesh, |p| p - middle);
    DemoPart::rigid(mesh, colour, move |time| trajectory.pose(time * SECONDS))
}

/// Displaces the interior of the cube `[-1, 1]^3` slightly and keeps each face in its plane. The pieces get varied
/// sizes and curved sides.
fn bend(p: DVec3, size: f64) -> DVec3 {
    let near = DVec3::ONE - p * p;
    let q = p / size;
    let fine = DVec3::from_array([21, 22, 23].map(|seed| noise(seed, q * 0.8)));
    let rough = DVec3::from_array([24, 25, 26].map(|seed| noise(seed, q * 3.0)));
    p + near * size * (0.4 * fine + 0.04 * rough)
}

fn colour_at(p: DVec3) -> Rgb {
    let depth = p.length() / RADIUS;
    if depth > 0.995 {
        let band = noise(31, p * 2.5) + 0.5 * noise(32, p * 6.0);
        return blend(CRUST, [96, 178, 160], 0.5 + 0.8 * band);
    }
    blend(CORE, RIND, (depth - 0.35) * 1.6)
}

/// Combines outward, swirling, upward and random velocity. The random part separates neighbours.
fn throw(piece: u64, middle: DVec3) -> Trajectory {
    let start = CENTRE + middle;
    let random = direction(41, piece) * between(42, piece, [0.3, 3.2]);
    let swirl = DVec3::Y.cross(middle) * between(43, piece, [-0.5, 2.5]);
    let up = DVec3::Y * between(44, piece, [0.5, 6.0]);
    Trajectory {
        start,
        velocity: middle * 1.1 + random + swirl + up,
        axis: direction(45, piece),
        spin: between(46, piece, [0.12, 0.76]) * TAU,
        rest: start.y.min(between(47, piece, [0.06, 0.16])),
    }
}
