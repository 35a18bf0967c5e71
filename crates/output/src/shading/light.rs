//! What a surface and an empty ray receive: a sky, its bounce off the ground, and one lamp.

use crate::shading::vector::{V3, dot, mix, scale};

/// Overhead, in linear light.
const ZENITH: V3 = [0.130, 0.270, 0.560];
/// At eye level.
const HORIZON: V3 = [0.640, 0.740, 0.830];
/// Below eye level: the haze one looks down into.
const HAZE: V3 = [0.400, 0.455, 0.510];
/// What reaches a surface that faces up, straight to the side, and down.
const FROM_ABOVE: V3 = [0.300, 0.355, 0.440];
const FROM_THE_SIDE: V3 = [0.195, 0.215, 0.250];
const FROM_BELOW: V3 = [0.105, 0.095, 0.085];
/// The lamp, head on.
const LAMP: V3 = [0.880, 0.800, 0.690];

/// The sky along a direction of length 1.
pub(crate) fn sky(direction: V3) -> V3 {
    let y = direction[1];
    if y < 0.0 {
        return mix(HORIZON, HAZE, smooth(-2.2 * y));
    }
    // Most of the change lies near the horizon, as in real air.
    let up = 1.0 - y;
    mix(HORIZON, ZENITH, 1.0 - up * up * up)
}

/// Light from all around on a surface with a normal of length 1.
pub(crate) fn ambient(normal: V3) -> V3 {
    let y = normal[1];
    if y < 0.0 {
        mix(FROM_THE_SIDE, FROM_BELOW, -y)
    } else {
        mix(FROM_THE_SIDE, FROM_ABOVE, y)
    }
}

/// Light from the lamp in direction `to_lamp` (length 1), if nothing is in the way.
pub(crate) fn lamp(normal: V3, to_lamp: V3) -> V3 {
    scale(LAMP, dot(normal, to_lamp).max(0.0))
}

/// From 0 to 1 with no kink at either end.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sky_has_no_seam_at_the_horizon() {
        let [above, below] = [1e-9, -1e-9].map(|y| sky([1.0, y, 0.0]));
        assert!((0..3).all(|i| (above[i] - below[i]).abs() < 1e-6));
    }

    #[test]
    fn a_surface_that_faces_up_gets_the_most_and_one_turned_away_gets_no_lamp() {
        let [up, side, down] = [1.0, 0.0, -1.0].map(|y| ambient([0.0, y, 0.0])[1]);
        assert!(up > side && side > down && down > 0.0);
        assert_eq!(lamp([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]), [0.0; 3]);
    }
}
