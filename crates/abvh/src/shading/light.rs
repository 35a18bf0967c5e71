//! Light of the sky, of the ground and of one lamp, and conversion between linear light and sRGB.
//!
//! The kernel `wgsl/visibility/shade.wgsl` computes the same bits on devices. For this, all operations per pixel are in
//! single precision and round once, without divisions and square roots. The host computes the tables.

use backend::Palette;
use glam::{Vec3, vec3};
use std::sync::LazyLock;

/// Light of the sky overhead, in linear light.
const ZENITH: Vec3 = vec3(0.130, 0.270, 0.560);
/// Light of the sky at eye level.
const HORIZON: Vec3 = vec3(0.640, 0.740, 0.830);
/// Light below eye level, which resembles haze.
const HAZE: Vec3 = vec3(0.400, 0.455, 0.510);
/// Ambient light on surfaces that face up, sideways and down.
const FROM_ABOVE: Vec3 = vec3(0.300, 0.355, 0.440);
const FROM_THE_SIDE: Vec3 = vec3(0.195, 0.215, 0.250);
const FROM_BELOW: Vec3 = vec3(0.105, 0.095, 0.085);
/// Light of the lamp at normal incidence.
const LAMP: Vec3 = vec3(0.880, 0.800, 0.690);

/// Returns the light of the sky in a direction of length 1.
pub(crate) fn sky(direction: Vec3) -> Vec3 {
    if direction.y < 0.0 {
        let x = (-2.2 * direction.y).min(1.0);
        return mix(HORIZON, HAZE, (x * x) * (3.0 - 2.0 * x));
    }
    // The light changes most near the horizon, as in real air.
    let up = 1.0 - direction.y;
    mix(HORIZON, ZENITH, 1.0 - (up * up) * up)
}

/// Returns the ambient light on a surface with a normal of length 1.
pub(crate) fn ambient(normal: Vec3) -> Vec3 {
    if normal.y < 0.0 {
        mix(FROM_THE_SIDE, FROM_BELOW, -normal.y)
    } else {
        mix(FROM_THE_SIDE, FROM_ABOVE, normal.y)
    }
}

/// Returns the light of an unoccluded lamp in direction `to_lamp`, which has length 1.
pub(crate) fn lamp(normal: Vec3, to_lamp: Vec3) -> Vec3 {
    LAMP * normal.dot(to_lamp).max(0.0)
}

/// Interpolates linearly between `a` and `b`.
fn mix(a: Vec3, b: Vec3, s: f32) -> Vec3 {
    a + (b - a) * s
}

/// Table entries per unit of linear light. From one entry to the next, sRGB changes by at most 0.81 of an 8-bit
/// level, at the dark end of the curve.
const STEPS: usize = 4096;

/// Last step of the table, which exceeds all light in this model.
const LAST_STEP: usize = 5120;

/// Linear light below this value is not compressed.
const KNEE: f64 = 0.7;

static TO_LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        let linear = if x <= 0.040_45 {
            x / 12.92
        } else {
            ((x + 0.055) / 1.055).powf(2.4)
        };
        linear as f32
    })
});

static FROM_LINEAR: LazyLock<[u8; LAST_STEP + 1]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = shoulder(i as f64 / STEPS as f64);
        let y = if x <= 0.003_130_8 {
            x * 12.92
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        };
        (y * 255.0).round() as u8
    })
});

/// Returns the identity up to the knee. Above it, approaches 1 smoothly.
fn shoulder(x: f64) -> f64 {
    let above = (x - KNEE).max(0.0);
    x.min(KNEE) + (1.0 - KNEE) * above / (above + (1.0 - KNEE))
}

/// Converts an sRGB colour to linear light.
pub(crate) fn linear(srgb: [u8; 3]) -> Vec3 {
    srgb.map(|c| TO_LINEAR[c as usize]).into()
}

/// Converts linear light to sRGB. Light above the knee is compressed.
pub(crate) fn encode(light: Vec3) -> [u8; 3] {
    let step = |x: f32| (x * STEPS as f32 + 0.5) as usize;
    light
        .to_array()
        .map(|x| FROM_LINEAR[step(x).min(LAST_STEP)])
}

/// Returns the tables that a device needs to shade triangles with these sRGB colours.
#[must_use]
pub(crate) fn palette(colours: &[[u8; 3]]) -> Palette {
    let linear = TO_LINEAR.iter().map(|x| x.to_bits());
    Palette {
        colours: colours
            .iter()
            .map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 255]))
            .collect(),
        tones: linear
            .chain(FROM_LINEAR.iter().copied().map(u32::from))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sky_is_continuous_at_the_horizon() {
        let [above, below] = [1e-7, -1e-7].map(|y| sky(vec3(1.0, y, 0.0)));
        assert!((0..3).all(|i| (above[i] - below[i]).abs() < 1e-5));
    }

    #[test]
    fn surface_orientation_determines_light() {
        let [up, side, down] = [1.0, 0.0, -1.0].map(|y| ambient(vec3(0.0, y, 0.0)).y);
        assert!(up > side && side > down && down > 0.0);
        assert_eq!(lamp(Vec3::Y, Vec3::NEG_Y), Vec3::ZERO);
    }

    #[test]
    fn colours_below_the_knee_round_trip() {
        let is_below_knee = |c: u8| f64::from(linear([c; 3]).x) < KNEE;
        assert!(is_below_knee(217) && !is_below_knee(218));
        // A step of the table is less than one level, so the nearest step has the same level.
        for c in 0..=217 {
            assert_eq!(encode(linear([c; 3])), [c; 3]);
        }
    }

    #[test]
    fn encoding_is_monotonic() {
        let level = |i| encode(Vec3::splat(i as f32 * 0.01))[0];
        assert!((0..4000).map(level).is_sorted());
        let brightest = FROM_LINEAR[LAST_STEP];
        let nonsense = vec3(f32::INFINITY, f32::NAN, -1.0);
        assert_eq!(encode(nonsense), [brightest, 0, 0]);
    }

    #[test]
    fn maximum_light_fits_the_table() {
        let most = FROM_ABOVE + LAMP;
        assert!(most.max_element() * 1.01 < LAST_STEP as f32 / STEPS as f32);
    }
}
