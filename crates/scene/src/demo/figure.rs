//! Walking figure: fourteen closed limbs on a jointed skeleton. Lengths are in metres, angles in radians.

use super::shapes::capsule;
use super::stage::{DemoPart, rotation};
use crate::Rgb;
use glam::{DAffine3, DVec3};
use std::f64::consts::TAU;

const SHIRT: Rgb = [214, 84, 62];
const TROUSERS: Rgb = [52, 66, 104];
const SKIN: Rgb = [226, 172, 134];
const HAIR: Rgb = [70, 48, 38];
const SHOES: Rgb = [58, 50, 48];
/// Height of the hips above the ground when both legs are straight.
const HIP: f64 = 0.93;
const THIGH: f64 = 0.43;
const SHIN: f64 = 0.42;
/// Minimum number of triangles of a figure: six per limb.
const FEWEST: usize = 14 * 6;

/// State of a walking figure: the ground position below it, and the phase of the stride in turns.
#[derive(Clone, Copy)]
pub(super) struct Stride {
    pub(super) ground: DVec3,
    pub(super) phase: f64,
}

/// Kind of limb. Functions also take a `side`: -1 for a left limb, 1 for a right limb, and 0 for a single limb.
#[derive(Clone, Copy)]
enum Limb {
    Pelvis,
    Chest,
    Head,
    Hair,
    UpperArm,
    Forearm,
    Thigh,
    Shin,
    Foot,
}

/// Shape of a limb, with its share of the triangles.
#[derive(Clone, Copy)]
struct LimbShape {
    limb: Limb,
    share: f64,
    length: f64,
    /// Radii at the joint and at the end.
    radii: [f64; 2],
    colour: Rgb,
}

const fn shape(limb: Limb, share: f64, [length, upper, lower]: [f64; 3], colour: Rgb) -> LimbShape {
    LimbShape {
        limb,
        share,
        length,
        radii: [upper, lower],
        colour,
    }
}

const SINGLE: [LimbShape; 4] = [
    shape(Limb::Pelvis, 0.08, [0.1, 0.13, 0.14], TROUSERS),
    shape(Limb::Chest, 0.14, [0.34, 0.16, 0.125], SHIRT),
    shape(Limb::Head, 0.12, [0.07, 0.1, 0.085], SKIN),
    shape(Limb::Hair, 0.06, [0.02, 0.106, 0.1], HAIR),
];
const PAIRED: [LimbShape; 5] = [
    shape(Limb::UpperArm, 0.06, [0.28, 0.058, 0.046], SHIRT),
    shape(Limb::Forearm, 0.06, [0.27, 0.044, 0.036], SKIN),
    shape(Limb::Thigh, 0.07, [THIGH, 0.086, 0.066], TROUSERS),
    shape(Limb::Shin, 0.06, [SHIN, 0.062, 0.046], TROUSERS),
    shape(Limb::Foot, 0.05, [0.15, 0.05, 0.044], SHOES),
];

/// Returns the limbs of a figure with about `budget` triangles that walks along `walk`. Returns no limbs if `budget` is
/// too small.
pub(super) fn figure(
    budget: usize,
    walk: impl Fn(f64) -> Stride + Copy + Send + Sync + 'static,
) -> Vec<DemoPart> {
    if budget < FEWEST {
        return Vec::new();
    }
    let part = |shape: LimbShape, side: f64| {
        let LimbShape { limb, colour, .. } = shape;
        let stretch = match limb {
            Limb::Chest => DVec3::new(0.72, 1.0, 1.12),
            Limb::Pelvis => DVec3::new(0.8, 0.8, 1.05),
            _ => DVec3::ONE,
        };
        let mesh = capsule(
            (shape.share * budget as f64) as usize,
            shape.length,
            shape.radii,
        )
        .map(|p| p * stretch);
        let pose = move |time| place(limb, side, walk(time));
        DemoPart::rigid(mesh, move |_| colour, pose)
    };
    let single = SINGLE.into_iter().map(|shape| part(shape, 0.0));
    let paired = PAIRED
        .into_iter()
        .flat_map(|shape| [-1.0, 1.0].map(|side| part(shape, side)));
    single.chain(paired).collect()
}

/// Returns the coordinate frame of a limb's joint. The y axis points up along the limb, x forward, z to the right.
fn place(limb: Limb, side: f64, stride: Stride) -> DAffine3 {
    let root = DAffine3::from_translation(stride.ground);
    let bob = 0.03 * libm::cos(2.0 * TAU * stride.phase) - 0.035;
    let lean = -0.06;
    let spine = root * joint(DVec3::new(0.0, HIP + bob, 0.0), lean);
    // Phase of the leg in radians. The thigh moves forward while the sine rises.
    let swing = TAU * (stride.phase + if side < 0.0 { 0.5 } else { 0.0 });
    let (sin, cos) = (libm::sin(swing), libm::cos(swing));
    let knee = 0.16 + 0.85 * cos.max(0.0) * cos.max(0.0);
    let parent = |limb| place(limb, side, stride);
    match limb {
        Limb::Pelvis => spine * joint(DVec3::new(0.0, 0.1, 0.0), 0.0),
        Limb::Chest => spine * joint(DVec3::new(0.0, 0.44, 0.0), 0.0),
        Limb::Head => spine * joint(DVec3::new(0.03, 0.76, 0.0), -lean),
        Limb::Hair => spine * joint(DVec3::new(0.005, 0.79, 0.0), -lean - 0.5),
        Limb::UpperArm => spine * joint(DVec3::new(0.0, 0.47, 0.215 * side), -0.5 * sin),
        Limb::Forearm => parent(Limb::UpperArm) * joint(DVec3::NEG_Y * 0.28, 0.4 - 0.2 * sin),
        Limb::Thigh => spine * joint(DVec3::new(0.0, 0.0, 0.1 * side), 0.42 * sin + 0.1 - lean),
        Limb::Shin => parent(Limb::Thigh) * joint(DVec3::NEG_Y * THIGH, -knee),
        Limb::Foot => {
            // The foot is flat while it carries weight, and its toes point down while it swings.
            let level = knee - 0.42 * sin - 0.1;
            let angle = level * (1.0 - 0.45 * cos.max(0.0)) + 1.57;
            parent(Limb::Shin) * joint(DVec3::new(-0.03, -SHIN, 0.0), angle)
        }
    }
}

/// Returns a coordinate frame at `at`, rotated by `angle` about z. A positive angle moves a hanging limb forward and
/// leans an upright one back.
fn joint(at: DVec3, angle: f64) -> DAffine3 {
    DAffine3::from_mat3_translation(rotation(DVec3::Z, angle), at)
}
