//! `demo:grove`: a clearing with trees and grass that sway in the wind, and a figure that walks through it.

use super::figure::{Stride, figure};
use super::shapes::{DemoMesh, revolve, revolve_size, sheet, sheet_size};
use super::stage::{DemoPart, blend, shade};
use super::{between, direction, noise, unit};
use crate::Rgb;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Half the side length of the ground, in metres.
const HALF: f64 = 4.5;
/// z coordinate of the path, which runs along x.
const PATH: f64 = 0.9;
const BARK: Rgb = [112, 84, 62];
const SOIL: Rgb = [168, 146, 104];
const MEADOW: Rgb = [128, 152, 78];
const LEAVES: [Rgb; 4] = [[86, 138, 60], [120, 160, 62], [62, 116, 74], [206, 150, 58]];

/// Builds about `budget` triangles: 1/10 ground, 1/10 figure, the grass and trees from the rest (1/6 and 5/6).
pub(super) fn build(budget: usize) -> Vec<DemoPart> {
    let mut parts = vec![ground((budget / 10).max(2))];
    parts.extend(figure(budget / 10, walk));
    let used: usize = parts.iter().map(DemoPart::len).sum();
    let left = budget.saturating_sub(used);
    parts.push(grass(left / 6));
    let trees = (libm::round((budget as f64).sqrt() / 32.0) as usize).max(1);
    let share = (left - left / 6) / trees;
    if share >= 20 {
        for index in 0..trees as u64 {
            parts.extend(tree(share, index, trees as u64));
        }
    }
    parts
}

/// Returns the ground height: gentle hills that are flat along the path.
fn hill(x: f64, z: f64) -> f64 {
    let off_path = ((z - PATH).abs() - 0.4).clamp(0.0, 2.0) * 0.5;
    0.3 * off_path * (1.0 + noise(101, DVec3::new(0.45 * x, 0.0, 0.45 * z)))
}

fn on_path(x: f64, z: f64) -> bool {
    let edge = 0.42 + 0.1 * noise(102, DVec3::new(2.0 * x, 0.0, 2.0 * z));
    (z - PATH).abs() < edge
}

fn ground(budget: usize) -> DemoPart {
    let mesh = sheet(sheet_size(budget, 1.0), |u, v| {
        let (x, z) = ((2.0 * u - 1.0) * HALF, (2.0 * v - 1.0) * HALF);
        DVec3::new(x, hill(x, z), z)
    });
    DemoPart::still(mesh, |p| {
        let base = if on_path(p.x, p.z) { SOIL } else { MEADOW };
        shade(base, 0.1 * noise(103, p * 1.3) + 0.06 * noise(104, p * 9.0))
    })
}

fn walk(time: f64) -> Stride {
    let x = -2.6 + 5.2 * time;
    Stride {
        ground: DVec3::new(x, hill(x, PATH), PATH),
        phase: 3.5 * time + 0.1,
    }
}

/// Returns point `p` of a plant at `root`, displaced by the wind. Gusts run along x and bend higher points more.
fn wind(root: DVec3, p: DVec3, time: f64, limber: f64) -> DVec3 {
    let height = (p.y - root.y).max(0.0);
    let gust = libm::sin(TAU * (1.5 * time - 0.11 * root.x - 0.07 * root.z));
    let breath = libm::sin(TAU * (2.6 * time + 0.31 * root.z + 0.13 * root.x));
    let bend = limber * height * height;
    let flutter =
        0.35 * limber * height * libm::sin(TAU * 3.0 * time + 9.0 * p.x + 7.0 * p.z + 5.0 * p.y);
    let aside = DVec2::new(
        bend * (0.5 + gust) + flutter,
        bend * 0.45 * breath + 0.6 * flutter,
    );
    // Lowers the point, so that the plant bends instead of shearing.
    p + DVec3::new(
        aside.x,
        -0.5 * aside.length_squared() / height.max(0.05),
        aside.y,
    )
}

/// Creates blades of three triangles each.
fn grass(budget: usize) -> DemoPart {
    let mut mesh = DemoMesh::default();
    for blade in 0..(budget / 3) as u64 {
        let [x, z] = [111, 112].map(|seed| between(seed, blade, [-HALF, HALF]));
        // Moves blades off the path instead of dropping them, so that their number does not change.
        let aside = if unit(113, blade) < 0.5 { -1.1 } else { 1.1 };
        let z = if on_path(x, z) { z + aside } else { z };
        add_blade(&mut mesh, blade, x, z);
    }
    let colour = |p: DVec3| {
        let tall = (p.y - hill(p.x, p.z)) * 3.0;
        let green = blend([92, 126, 58], [186, 190, 96], tall);
        shade(green, 0.2 * noise(114, p * 7.0))
    };
    DemoPart::new(mesh, colour, |time| {
        move |p| wind(DVec3::new(p.x, hill(p.x, p.z), p.z), p, time, 0.5)
    })
}

fn add_blade(mesh: &mut DemoMesh, blade: u64, x: f64, z: f64) {
    let root = DVec3::new(x, hill(x, z), z);
    let angle = TAU * unit(115, blade);
    let across =
        DVec3::new(libm::cos(angle), 0.0, libm::sin(angle)) * between(116, blade, [0.006, 0.014]);
    let height = between(117, blade, [0.1, 0.32]);
    let lean = direction(118, blade) * DVec3::new(1.0, 0.0, 1.0) * 0.35 * height;
    let middle = root + DVec3::Y * 0.55 * height + 0.35 * lean;
    let tip = root + DVec3::Y * height + lean;
    let (low, high) = (across, 0.7 * across);
    let points = [root - low, root + low, middle - high, middle + high, tip];
    mesh.add(points, [[0, 1, 3], [0, 3, 2], [2, 3, 4]]);
}

/// Creates a trunk and a crown. Trees are arranged in a golden-angle spiral, away from the path.
fn tree(budget: usize, index: u64, count: u64) -> [DemoPart; 2] {
    let golden = 0.618_033_988_749_895 * index as f64;
    let reach = HALF * 0.9 * ((index as f64 + 1.2) / (count as f64 + 0.7)).sqrt();
    let angle = TAU * golden;
    let (x, mut z) = (reach * libm::cos(angle), reach * libm::sin(angle));
    if (z - PATH).abs() < 0.9 {
        z = PATH + if z < PATH { -0.9 } else { 0.9 };
    }
    // Trees in front are short, so that they do not hide the figure.
    let height = between(121, index, [1.7, 3.0]) * if z > PATH { 0.36 } else { 1.0 };
    let root = DVec3::new(x, hill(x, z), z);
    let trunk = trunk(budget / 12, root, height);
    let crown = crown(budget - trunk.len(), index, root, height);
    [trunk, crown]
}

fn trunk(budget: usize, root: DVec3, height: f64) -> DemoPart {
    let mesh = revolve(revolve_size(budget, 3.0), |v| {
        let flare = 0.05 * libm::exp(-9.0 * (1.0 - v));
        DVec2::new(
            height * (0.012 + 0.026 * v + flare),
            height * 0.8 * (1.0 - v) - 0.04,
        )
    });
    let colour = |p: DVec3| shade(BARK, 0.25 * noise(122, p * DVec3::new(25.0, 5.0, 25.0)));
    DemoPart::new(mesh.map(|p| p + root), colour, move |time| {
        move |p| wind(root, p, time, 0.022)
    })
}

/// Creates a crown: folded leaves of four triangles each, inside an egg-shaped volume.
fn crown(budget: usize, tree: u64, root: DVec3, height: f64) -> DemoPart {
    let leaves = (budget / 4).max(1) as u64;
    let size = height * (0.85 / (leaves as f64).cbrt()).clamp(0.012, 0.12);
    let mut mesh = DemoMesh::default();
    for leaf in 0..leaves {
        let seed = 131 + 16 * tree;
        let out = direction(seed, leaf);
        let depth = libm::cbrt(between(seed + 1, leaf, [0.25, 1.0]));
        let clump = 1.0 + 0.25 * noise(seed + 2, out * 2.5);
        let egg = DVec3::new(0.3, 0.36, 0.3) * height * depth * clump;
        let middle = root + DVec3::Y * 0.72 * height + out * egg;
        let aim = (out + 0.8 * direction(seed + 3, leaf) - DVec3::Y * 0.3).normalize();
        let size = size * between(seed + 4, leaf, [0.7, 1.3]);
        add_leaf(&mut mesh, middle, aim, size);
    }
    let base = LEAVES[(tree % LEAVES.len() as u64) as usize];
    let top = root.y + height;
    let colour = move |p: DVec3| {
        let mottle = 0.22 * noise(133, p * 15.0);
        shade(base, mottle + 0.25 * (p.y - top) / height + 0.12)
    };
    DemoPart::new(mesh, colour, move |time| {
        move |p| wind(root, p, time, 0.022)
    })
}

fn add_leaf(mesh: &mut DemoMesh, stem: DVec3, aim: DVec3, size: f64) {
    let across = aim.any_orthonormal_vector();
    let fold = aim.cross(across) * 0.22;
    let at = |along: f64, side: f64| {
        stem + size * (along * aim + side * (across * 0.42) + side.abs() * fold)
    };
    let (left, right) = (at(0.45, -1.0), at(0.45, 1.0));
    let points = [at(0.0, 0.0), left, at(0.5, 0.0), right, at(1.0, 0.0)];
    mesh.add(points, [[0, 2, 1], [1, 2, 4], [0, 3, 2], [2, 3, 4]]);
}
