//! From 8-bit sRGB to linear light and back (IEC 61966-2-1), with a gentle shoulder on the way.

use crate::shading::vector::V3;
use std::sync::LazyLock;

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
pub(crate) fn linear(srgb: [u8; 3]) -> V3 {
    srgb.map(|c| TO_LINEAR[c as usize])
}

/// The sRGB colour of linear light, bright light rolled off.
pub(crate) fn encode(light: V3) -> [u8; 3] {
    light.map(|x| FROM_LINEAR[(shoulder(x) * STEPS as f64 + 0.5) as usize])
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
            .map(|i| encode([f64::from(i) * 0.01; 3])[0])
            .collect();
        assert!(levels.is_sorted());
        assert_eq!(encode([f64::INFINITY, f64::NAN, -1.0]), [255, 0, 0]);
    }
}
