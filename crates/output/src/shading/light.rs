//! What a surface and an empty ray receive: a sky, its bounce off the ground, and one lamp; linear light as sRGB.

use glam::{DVec3, dvec3};
use std::sync::LazyLock;

/// Overhead, in linear light.
const ZENITH: DVec3 = dvec3(0.130, 0.270, 0.560);
/// At eye level.
const HORIZON: DVec3 = dvec3(0.640, 0.740, 0.830);
/// Below eye level: the haze one looks down into.
const HAZE: DVec3 = dvec3(0.400, 0.455, 0.510);
/// What reaches a surface that faces up, straight to the side, and down.
const FROM_ABOVE: DVec3 = dvec3(0.300, 0.355, 0.440);
const FROM_THE_SIDE: DVec3 = dvec3(0.195, 0.215, 0.250);
const FROM_BELOW: DVec3 = dvec3(0.105, 0.095, 0.085);
/// The lamp, head on.
const LAMP: DVec3 = dvec3(0.880, 0.800, 0.690);

/// The sky along a direction of length 1.
pub(crate) fn sky(direction: DVec3) -> DVec3 {
    let y = direction.y;
    if y < 0.0 {
        return mix(HORIZON, HAZE, smooth(-2.2 * y));
    }
    // Most of the change lies near the horizon, as in real air.
    let up = 1.0 - y;
    mix(HORIZON, ZENITH, 1.0 - up * up * up)
}

/// Light from all around on a surface with a normal of length 1.
pub(crate) fn ambient(normal: DVec3) -> DVec3 {
    let y = normal.y;
    if y < 0.0 {
        mix(FROM_THE_SIDE, FROM_BELOW, -y)
    } else {
        mix(FROM_THE_SIDE, FROM_ABOVE, y)
    }
}

/// Light from the lamp in direction `to_lamp` (length 1), if nothing is in the way.
pub(crate) fn lamp(normal: DVec3, to_lamp: DVec3) -> DVec3 {
    LAMP * normal.dot(to_lamp).max(0.0)
}

/// From 0 to 1 with no kink at either end.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Part of the way from one to the other.
fn mix(a: DVec3, b: DVec3, s: f64) -> DVec3 {
    a + (b - a) * s
}

/// Steps of the way back; in the darkest, steepest part one step is 0.8 of an 8-bit level.
const STEPS: usize = 4096;

/// Linear light below this stays as it is.
const KNEE: f64 = 0.7;

static TO_LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        if x <= 0.040_45 {
            x / 12.92
        } else {
            ((x + 0.055) / 1.055).powf(2.4)
        }
    })
});

static FROM_LINEAR: LazyLock<[u8; STEPS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / STEPS as f64;
        let y = if x <= 0.003_130_8 {
            x * 12.92
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        };
        (y * 255.0).round() as u8
    })
});

/// Linear light of an sRGB colour.
pub(crate) fn linear(srgb: [u8; 3]) -> DVec3 {
    srgb.map(|c| TO_LINEAR[c as usize]).into()
}

/// The sRGB colour of linear light, bright light rolled off.
pub(crate) fn encode(light: DVec3) -> [u8; 3] {
    light
        .to_array()
        .map(|x| FROM_LINEAR[(shoulder(x) * STEPS as f64 + 0.5) as usize])
}

/// The identity up to the knee, then smoothly towards 1. Whatever is no number is black.
fn shoulder(x: f64) -> f64 {
    let above = x - KNEE;
    if above <= 0.0 {
        x.max(0.0)
    } else if above.is_finite() {
        KNEE + (1.0 - KNEE) * above / (above + (1.0 - KNEE))
    } else if x > 0.0 {
        1.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sky_has_no_seam_at_the_horizon() {
        let [above, below] = [1e-9, -1e-9].map(|y| sky(dvec3(1.0, y, 0.0)));
        assert!((0..3).all(|i| (above[i] - below[i]).abs() < 1e-6));
    }

    #[test]
    fn a_surface_that_faces_up_gets_the_most_and_one_turned_away_gets_no_lamp() {
        let [up, side, down] = [1.0, 0.0, -1.0].map(|y| ambient(dvec3(0.0, y, 0.0)).y);
        assert!(up > side && side > down && down > 0.0);
        assert_eq!(lamp(DVec3::Y, DVec3::NEG_Y), DVec3::ZERO);
    }

    #[test]
    fn colours_below_the_knee_come_back_as_they_were() {
        // 218 is the last sRGB level whose linear light lies below the knee.
        for c in 0..=218 {
            let back = encode(linear([c; 3]))[0];
            assert!(back.abs_diff(c) <= 1, "{c} became {back}");
        }
    }

    #[test]
    fn brighter_light_is_never_darker_and_nonsense_is_no_panic() {
        let levels: Vec<u8> = (0..4000)
            .map(|i| encode(DVec3::splat(f64::from(i) * 0.01))[0])
            .collect();
        assert!(levels.is_sorted());
        assert_eq!(encode(dvec3(f64::INFINITY, f64::NAN, -1.0)), [255, 0, 0]);
    }
}
