//! Walking figure: fourteen closed limbs on a jointed skeleton. Lengths are in metres, angles in radians.

use super::shapes::capsule;
use super::stage::{Part, rotation};
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
pub(super) struct Step {
    pub(super) ground: DVec3,
    pub(super) phase: f64,
}

/// Kind of limb, attached at a joint. `side` is -1 for a left limb, 1 for a right one, and 0 for a single one.
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

/// Limb with its share of the triangles, length, radii at joint and end, and colour.
type Look = (Limb, f64, f64, [f64; 2], Rgb);

const SINGLE: [Look; 4] = [
    (Limb::Pelvis, 0.08, 0.1, [0.13, 0.14], TROUSERS),
    (Limb::Chest, 0.14, 0.34, [0.16, 0.125], SHIRT),
    (Limb::Head, 0.12, 0.07, [0.1, 0.085], SKIN),
    (Limb::Hair, 0.06, 0.02, [0.106, 0.1], HAIR),
];
const PAIRED: [Look; 5] = [
    (Limb::UpperArm, 0.06, 0.28, [0.058, 0.046], SHIRT),
    (Limb::Forearm, 0.06, 0.27, [0.044, 0.036], SKIN),
    (Limb::Thigh, 0.07, THIGH, [0.086, 0.066], TROUSERS),
    (Limb::Shin, 0.06, SHIN, [0.062, 0.046], TROUSERS),
    (Limb::Foot, 0.05, 0.15, [0.05, 0.044], SHOES),
];

/// Returns the limbs of a figure with about `budget` triangles that walks along `walk`. Returns no limbs if `budget` is
/// too small.
pub(super) fn figure(
    budget: usize,
    walk: impl Fn(f64) -> Step + Copy + Send + Sync + 'static,
) -> Vec<Part> {
    if budget < FEWEST {
        return Vec::new();
    }
    let single = SINGLE.map(|look| (look, 0.0)).into_iter();
    let sides = |look| [(look, -1.0), (look, 1.0)];
    let part = |((limb, share, length, radii, colour), side): (Look, f64)| {
        let stretch = match limb {
            Limb::Chest => DVec3::new(0.72, 1.0, 1.12),
            Limb::Pelvis => DVec3::new(0.8, 0.8, 1.05),
            _ => DVec3::ONE,
        };
        let mesh = capsule((share * budget as f64) as usize, length, radii).map(|p| p * stretch);
        let pose = move |time| place(limb, side, walk(time));
        Part::rigid(mesh, move |_| colour, pose)
    };
    let paired = PAIRED.into_iter().flat_map(sides);
    single.chain(paired).map(part).collect()
}

/// Returns sine and cosine of the thigh's swing angle. The thigh moves forward while the sine rises.
fn swing(step: Step, side: f64) -> (f64, f64) {
    let angle = TAU * (step.phase + if side < 0.0 { 0.5 } else { 0.0 });
    (libm::sin(angle), libm::cos(angle))
}

/// Returns the frame of a limb's joint. The y axis points up along the limb, x forward, z to the right.
fn place(limb: Limb, side: f64, step: Step) -> DAffine3 {
    let root = DAffine3::from_translation(step.ground);
    let bob = 0.03 * libm::cos(2.0 * TAU * step.phase) - 0.035;
    let lean = -0.06;
    let spine = root * joint(DVec3::new(0.0, HIP + bob, 0.0), lean);
    let (sin, cos) = swing(step, side);
    let knee = 0.16 + 0.85 * cos.max(0.0) * cos.max(0.0);
    let above = |limb| place(limb, side, step);
    match limb {
        Limb::Pelvis => spine * joint(DVec3::new(0.0, 0.1, 0.0), 0.0),
        Limb::Chest => spine * joint(DVec3::new(0.0, 0.44, 0.0), 0.0),
        Limb::Head => spine * joint(DVec3::new(0.03, 0.76, 0.0), -lean),
        Limb::Hair => spine * joint(DVec3::new(0.005, 0.79, 0.0), -lean - 0.5),
        Limb::UpperArm => spine * joint(DVec3::new(0.0, 0.47, 0.215 * side), -0.5 * sin),
        Limb::Forearm => above(Limb::UpperArm) * joint(DVec3::NEG_Y * 0.28, 0.4 - 0.2 * sin),
        Limb::Thigh => spine * joint(DVec3::new(0.0, 0.0, 0.1 * side), 0.42 * sin + 0.1 - lean),
        Limb::Shin => above(Limb::Thigh) * joint(DVec3::NEG_Y * THIGH, -knee),
        Limb::Foot => {
            // The foot is flat while it carries weight, and its toes point down while it swings.
            let level = knee - 0.42 * sin - 0.1;
            let angle = level * (1.0 - 0.45 * cos.max(0.0)) + 1.57;
            above(Limb::Shin) * joint(DVec3::new(-0.03, -SHIN, 0.0), angle)
        }
    }
}

/// Returns a frame at `at` that is rotated forward by `angle`.
fn joint(at: DVec3, angle: f64) -> DAffine3 {
    DAffine3::from_mat3_translation(rotation(DVec3::Z, angle), at)
}
