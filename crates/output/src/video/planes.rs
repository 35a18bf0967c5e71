//! Video frames as luma and chroma planes: BT.601 in limited range, which YUV4MPEG2 readers assume.

/// Luma and chroma planes of a frame, with one sample per pixel (4:4:4).
#[derive(Clone, Debug, Default)]
pub struct VideoPlanes {
    luma: Vec<u8>,
    cb: Vec<u8>,
    cr: Vec<u8>,
}

impl VideoPlanes {
    /// Converts sRGB pixels, row by row. Ignores the fourth byte of a pixel. Runs on the calling thread only, because
    /// other frames are converted in parallel.
    pub fn set(&mut self, pixels: &[[u8; 4]]) {
        let Self { luma, cb, cr } = self;
        for plane in [&mut *luma, &mut *cb, &mut *cr] {
            plane.resize(pixels.len(), 0);
        }
        for (i, pixel) in pixels.iter().enumerate() {
            luma[i] = luma_of(*pixel);
            [cb[i], cr[i]] = chroma_of(*pixel);
        }
    }

    pub(super) fn frame(&self) -> y4m::Frame<'_> {
        y4m::Frame::new([&self.luma, &self.cb, &self.cr], None)
    }
}

/// Returns the luma of a pixel, rounded to nearest. Weights are in units of 1/65536.
fn luma_of([r, g, b, _]: [u8; 4]) -> u8 {
    let [r, g, b] = [r, g, b].map(u32::from);
    ((r * 16_829 + g * 33_039 + b * 6_416 + (16 << 16) + (1 << 15)) >> 16) as u8
}

/// Returns Cb and Cr of a pixel, rounded to nearest. Weights are in units of 1/65536.
fn chroma_of([r, g, b, _]: [u8; 4]) -> [u8; 2] {
    let [r, g, b] = [r, g, b].map(u32::from);
    let middle = (128 << 16) + (1 << 15);
    let cb = middle + b * 28_784 - r * 9_714 - g * 19_070;
    let cr = middle + r * 28_784 - g * 24_103 - b * 4_681;
    [cb, cr].map(|value| (value >> 16) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns Y', Cb and Cr of channels in 0 to 255.
    fn exact([r, g, b]: [f64; 3]) -> [f64; 3] {
        let [r, g, b] = [r, g, b].map(|x| x / 255.0);
        [
            16.0 + 65.481 * r + 128.553 * g + 24.966 * b,
            128.0 - 37.797 * r - 74.203 * g + 112.0 * b,
            128.0 + 112.0 * r - 93.786 * g - 18.214 * b,
        ]
    }

    #[test]
    fn luma_and_chroma_round_to_nearest() {
        // Every third value per channel, including 0 and 255.
        let axis = || (0..=255_u8).step_by(3);
        let all = axis().flat_map(|r| axis().flat_map(move |g| axis().map(move |b| [r, g, b, 7])));
        let all: Vec<[u8; 4]> = all.collect();
        let mut planes = VideoPlanes::default();
        planes.set(&all);
        for (i, &[r, g, b, _]) in all.iter().enumerate() {
            let exact = exact([r, g, b].map(f64::from));
            let found = [planes.luma[i], planes.cb[i], planes.cr[i]];
            for (value, exact) in found.into_iter().zip(exact) {
                assert!((f64::from(value) - exact).abs() < 0.51, "{value}: {exact}");
            }
        }
    }
}
