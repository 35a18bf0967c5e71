//! From what files say about colours to sRGB.

use crate::Rgb;

/// Of what has no colour.
pub(crate) const CLAY: Rgb = [204, 196, 184];

/// From components that are already meant for display; out of range or not a number is clamped.
pub(crate) fn from_display(colour: [f32; 3]) -> Rgb {
    colour.map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

/// From linear light (IEC 61966-2-1).
pub(crate) fn from_linear(colour: [f32; 3]) -> Rgb {
    from_display(colour.map(|c| {
        let c = f64::from(c.clamp(0.0, 1.0));
        let encoded = if c <= 0.003_130_8 {
            12.92 * c
        } else {
            1.055 * libm::pow(c, 1.0 / 2.4) - 0.055
        };
        encoded as f32
    }))
}

/// The mean of a triangle's vertices.
pub(crate) fn mean(colours: [Rgb; 3]) -> Rgb {
    std::array::from_fn(|i| (colours.iter().map(|c| u32::from(c[i])).sum::<u32>() / 3) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_light_is_encoded_as_srgb() {
        assert_eq!(from_linear([0.0, 1.0, 0.214_041_14]), [0, 255, 128]);
        assert_eq!(from_linear([0.003, 0.002, 0.01]), [10, 7, 25]);
        assert_eq!(from_linear([f32::NAN, -1.0, 7.0]), [0, 0, 255]);
    }
}
