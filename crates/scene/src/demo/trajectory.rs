//! Fragments in flight: thrown, slowed by air, tumbling, bouncing until they lie on the floor.

use super::stage::rotation;
use glam::{DAffine3, DVec3};

/// How one fragment is thrown; metres, seconds, radians.
#[derive(Clone, Copy)]
pub(super) struct Trajectory {
    /// Its middle at the start.
    pub(super) start: DVec3,
    /// Its velocity at the start.
    pub(super) velocity: DVec3,
    /// A unit vector.
    pub(super) axis: DVec3,
    /// Radians a second round `axis` at the start.
    pub(super) spin: f64,
    /// Height of its middle when it lies on the floor; at most `start.y`.
    pub(super) rest: f64,
}

impl Trajectory {
    /// Where it is, and how turned, after some seconds.
    pub(super) fn pose(&self, seconds: f64) -> DAffine3 {
        const DRAG: f64 = 0.45;
        let slowed = (1.0 - libm::exp(-DRAG * seconds)) / DRAG;
        let mut place = self.start + self.velocity * slowed;
        place.y = self.rest + bounce(self.start.y - self.rest, self.velocity.y, seconds);
        DAffine3::from_mat3_translation(rotation(self.axis, self.spin * slowed), place)
    }
}

/// Height above the floor of a ball thrown up from `height`, which loses three fifths of its speed at each bounce.
fn bounce(mut height: f64, mut speed: f64, mut seconds: f64) -> f64 {
    const GRAVITY: f64 = 9.81;
    for _ in 0..6 {
        let landing_speed = (speed * speed + 2.0 * GRAVITY * height).sqrt();
        let trajectory = (speed + landing_speed) / GRAVITY;
        if seconds < trajectory {
            return (height + (speed - 0.5 * GRAVITY * seconds) * seconds).max(0.0);
        }
        (height, speed, seconds) = (0.0, 0.4 * landing_speed, seconds - trajectory);
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thrown_ball_lands_and_comes_to_rest_without_jumps() {
        let at = |ms: u32| bounce(1.0, 3.0, f64::from(ms) / 1000.0);
        assert_eq!(at(0), 1.0);
        assert_eq!(at(60_000), 0.0);
        assert!(at(851) < 0.01 && at(1000) > 0.1);
        assert!((0..3000).all(|ms| at(ms) >= 0.0 && (at(ms + 1) - at(ms)).abs() < 0.01));
    }
}
