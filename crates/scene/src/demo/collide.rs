//! `demo:collide`: two soft bodies collide, flatten, separate and wobble away, while splinters burst out between them.

use super::shapes::{cube, cube_cuts, onto_ball};
use super::stage::{DemoPart, Trajectory, blend, rotation, shade};
use super::{between, direction, noise};
use crate::Rgb;
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::{PI, TAU};

/// Duration of the animation in seconds. Only the flight of the splinters depends on it.
const SECONDS: f64 = 2.0;
/// Times at which the bodies touch and separate, as fractions of the duration.
const CONTACT: [f64; 2] = [0.32, 0.52];
/// Speed of the bodies before and after contact, in radii per duration.
const SPEED: [f64; 2] = [6.5, 4.6];
const FLOOR: Rgb = [205, 203, 210];
/// Splinter colour of each body.
const SPLINTERS: [Rgb; 2] = [[226, 120, 48], [120, 170, 172]];

/// One of the two bodies. `side` is -1 for the left one.
#[derive(Clone, Copy)]
struct SoftBody {
    side: f64,
    /// Relative depth of the grooves between meridian lobes.
    lobes: f64,
    /// Axis of rotation.
    axis: DVec3,
    /// Rotation in radians per duration, until the bodies separate.
    spin: f64,
}

const BODIES: [SoftBody; 2] = [
    SoftBody {
        side: -1.0,
        lobes: 0.1,
        axis: DVec3::Z,
        spin: -0.55 * TAU,
    },
    SoftBody {
        side: 1.0,
        lobes: 0.0,
        axis: DVec3::new(0.0, 0.6, 0.8),
        spin: 0.45 * TAU,
    },
];

/// Builds about `budget` triangles: two bodies of equal size, a floor, and splinters if the budget is large enough.
pub(super) fn build(budget: usize) -> Vec<DemoPart> {
    let cuts = cube_cuts(budget * 46 / 100);
    let mut parts: Vec<DemoPart> = BODIES.into_iter().map(|b| body(b, cuts)).collect();
    let left = budget.saturating_sub(24 * (cuts * cuts) as usize);
    let floor = DemoPart::floor((left / 4).max(2), [10.0, 6.25], FLOOR, |p| {
        noise(73, p * 1.5)
    });
    let splinters = left.saturating_sub(floor.len()) / 12;
    parts.push(floor);
    parts.extend((0..splinters as u64).map(splinter));
    parts
}

fn body(body: SoftBody, cuts: u32) -> DemoPart {
    let mesh = cube(cuts).map(|p| relief(body, onto_ball(p)));
    DemoPart::new(
        mesh,
        move |p| paint(body, p),
        move |time| move |p| body.place(p, time),
    )
}

/// Adds meridian lobes that fade towards the poles. One body then resembles a pumpkin.
fn relief(body: SoftBody, p: DVec3) -> DVec3 {
    let angle = libm::atan2(p.z, p.x);
    let rim = 1.0 - p.y * p.y;
    p * (1.0 - body.lobes * rim * (0.5 - 0.5 * libm::cos(10.0 * angle)))
}

fn paint(body: SoftBody, p: DVec3) -> Rgb {
    let speckle = 0.06 * noise(71, p * 20.0);
    if body.side < 0.0 {
        let groove = 0.5 - 0.5 * libm::cos(10.0 * libm::atan2(p.z, p.x));
        let skin = blend([240, 138, 56], [188, 78, 36], groove);
        let stem = if p.y > 0.93 { [92, 112, 52] } else { skin };
        return shade(stem, speckle);
    }
    let band = 0.5 + 4.0 * libm::sin(7.0 * p.y + 1.5 * noise(72, p * 2.0));
    shade(blend([28, 104, 122], [236, 226, 200], band), speckle)
}

impl SoftBody {
    /// Returns the distance of the body's centre from the contact plane.
    fn distance(&self, time: f64) -> f64 {
        let [touch, part] = CONTACT;
        if time < touch {
            1.0 + SPEED[0] * (touch - time)
        } else if time < part {
            // The depth makes the speed continuous at the first contact.
            1.0 - SPEED[0] * (part - touch) / PI * libm::sin(PI * (time - touch) / (part - touch))
        } else {
            1.0 + SPEED[1] * (time - part)
        }
    }

    /// Returns the height of the centre: up and down in an arc, then one hop after landing.
    fn height(&self, time: f64) -> f64 {
        let arc = (time - 0.3) / 0.48;
        let fall = 1.04 + 0.9 * (1.0 - arc * arc);
        let hop = (time - 0.78) * (0.98 - time) * 14.0;
        if time < 0.78 {
            fall
        } else {
            1.04 + hop.max(0.0)
        }
    }

    fn place(&self, p: DVec3, time: f64) -> DVec3 {
        let slow = time.min(CONTACT[1]) + 0.6 * (time - CONTACT[1]).max(0.0);
        let p = wobble(time) * (rotation(self.axis, self.spin * slow) * p);
        // Distance from the contact plane into this body's own half.
        let inward = self.distance(time) - p.x * -self.side;
        let flat = soft_wall(inward);
        let bulge = 1.0 + 0.9 * (flat - inward).clamp(0.0, 0.5);
        DVec3::new(
            self.side * flat,
            self.height(time) + p.y * bulge,
            p.z * bulge,
        )
    }
}

/// Limits points to the body's side of the contact plane. The function is the identity beyond `SKIN`, and strictly
/// monotone, so points keep their order.
fn soft_wall(inward: f64) -> f64 {
    const SKIN: f64 = 0.12;
    if inward >= SKIN {
        inward
    } else {
        SKIN * libm::exp((inward - SKIN) / SKIN)
    }
}

/// Returns a stretch along x that oscillates and decays after the bodies separate.
fn wobble(time: f64) -> DMat3 {
    let after = (time - CONTACT[1]).max(0.0);
    let stretch = 1.0 + 0.22 * libm::sin(after * TAU / 0.24) * libm::exp(-5.0 * after);
    let thin = 1.0 / stretch.sqrt();
    DMat3::from_diagonal(DVec3::new(stretch, thin, thin))
}

/// Creates a closed splinter. It is hidden in its body until contact. Then it flies upward and away from the line
/// through the centres of the bodies.
fn splinter(index: u64) -> DemoPart {
    let which = (index % 2) as usize;
    let owner = BODIES[which];
    let size = between(81, index, [0.012, 0.045]);
    let shape = DVec3::new(
        1.0,
        between(82, index, [0.4, 1.0]),
        between(83, index, [0.15, 0.5]),
    ) * size;
    let mesh = cube(1).map(|p| (p + 0.35 * direction(84, index)) * shape);
    let colour = shade(SPLINTERS[which], between(85, index, [-0.2, 0.2]));
    let around = TAU * between(86, index, [0.0, 1.0]);
    let out = DVec3::new(0.0, libm::cos(around), libm::sin(around));
    let within = out * between(87, index, [0.1, 0.5]);
    let at = move |time: f64| {
        DVec3::X * owner.side * (owner.distance(time) - 0.5)
            + DVec3::Y * owner.height(time)
            + within
    };
    let start = at(CONTACT[0]);
    let trajectory = Trajectory {
        start,
        velocity: out * between(88, index, [0.8, 3.6])
            + DVec3::X * owner.side * between(89, index, [-0.6, 2.2])
            + DVec3::Y * between(90, index, [0.0, 2.5]),
        axis: direction(91, index),
        spin: between(92, index, [0.2, 1.0]) * TAU,
        rest: start.y.min(size),
    };
    DemoPart::rigid(
        mesh,
        move |_| colour,
        move |time| {
            let shift = at(time.min(CONTACT[0])) - start;
            DAffine3::from_translation(shift)
                * trajectory.pose((time - CONTACT[0]).max(0.0) * SECONDS)
        },
    )
}
