//! Video frames as luma and chroma planes: BT.601 in limited range, which YUV4MPEG2 readers assume.

/// Selection of chroma sizes to compute.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chroma {
    /// One sample per two by two pixels (4:2:0).
    pub halved: bool,
    /// One sample per pixel (4:4:4).
    pub full: bool,
}

impl Chroma {
    /// Returns whether any size is selected.
    #[must_use]
    pub fn any(self) -> bool {
        self.halved || self.full
    }
}

/// Luma and chroma planes of a frame.
#[derive(Clone, Debug, Default)]
pub struct Planes {
    luma: Vec<u8>,
    /// Cb and Cr at half size.
    halved: [Vec<u8>; 2],
    /// Cb and Cr at full size.
    full: [Vec<u8>; 2],
}

impl Planes {
    /// Converts sRGB pixels in rows of `width`. The fourth byte of a pixel is ignored. Runs on the calling thread only,
    /// because other frames are converted in parallel.
    pub fn set(&mut self, pixels: &[[u8; 4]], width: usize, chroma: Chroma) {
        self.luma.resize(pixels.len(), 0);
        for (pixel, luma) in pixels.iter().zip(&mut self.luma) {
            *luma = luma_of(*pixel);
        }
        if chroma.halved {
            set_halved(pixels, width.max(1), &mut self.halved);
        }
        if chroma.full {
            self.full.iter_mut().for_each(|p| p.resize(pixels.len(), 0));
            let [cb, cr] = &mut self.full;
            for (pixel, (cb, cr)) in pixels.iter().zip(cb.iter_mut().zip(cr)) {
                [*cb, *cr] = chroma_of([*pixel; 4]);
            }
        }
    }

    /// Returns the frame as 4:2:0 if `halved`, else as 4:4:4.
    pub(super) fn frame(&self, halved: bool) -> y4m::Frame<'_> {
        let [cb, cr] = if halved { &self.halved } else { &self.full };
        y4m::Frame::new([&self.luma, cb, cr], None)
    }
}

/// Computes chroma of blocks of two by two pixels. At an odd edge, the existing pixels count twice.
fn set_halved(pixels: &[[u8; 4]], width: usize, planes: &mut [Vec<u8>; 2]) {
    let half = width.div_ceil(2);
    let samples = half * (pixels.len() / width).div_ceil(2);
    planes.iter_mut().for_each(|p| p.resize(samples, 0));
    let [cb, cr] = planes.each_mut().map(|plane| plane.chunks_mut(half));
    for (rows, (cb, cr)) in pixels.chunks(2 * width).zip(cb.zip(cr)) {
        let (upper, lower) = rows.split_at(width);
        let lower = if lower.is_empty() { upper } else { lower };
        let (upper, upper_edge) = upper.as_chunks::<2>();
        let (lower, lower_edge) = lower.as_chunks::<2>();
        let pairs = upper.iter().zip(lower);
        for (([a, b], [c, d]), (cb, cr)) in pairs.zip(cb.iter_mut().zip(cr.iter_mut())) {
            [*cb, *cr] = chroma_of([*a, *b, *c, *d]);
        }
        if let ([a], [c], [.., cb], [.., cr]) = (upper_edge, lower_edge, cb, cr) {
            [*cb, *cr] = chroma_of([*a, *a, *c, *c]);
        }
    }
}

/// Returns the luma of a pixel, rounded to nearest. Weights are in units of 1/65536.
fn luma_of([r, g, b, _]: [u8; 4]) -> u8 {
    let [r, g, b] = [r, g, b].map(u32::from);
    ((r * 16_829 + g * 33_039 + b * 6_416 + (16 << 16) + (1 << 15)) >> 16) as u8
}

/// Returns Cb and Cr of the mean of four pixels, rounded to nearest.
fn chroma_of(pixels: [[u8; 4]; 4]) -> [u8; 2] {
    let [r, g, b] = [0, 1, 2].map(|c| pixels.iter().map(|p| u32::from(p[c])).sum::<u32>());
    let middle = (128 << 18) + (1 << 17);
    let cb = middle + b * 28_784 - r * 9_714 - g * 19_070;
    let cr = middle + r * 28_784 - g * 24_103 - b * 4_681;
    [cb, cr].map(|value| (value >> 18) as u8)
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

    fn assert_near(value: u8, exact: f64) {
        assert!((f64::from(value) - exact).abs() < 0.51, "{value}: {exact}");
    }

    #[test]
    fn chroma_halving_repeats_edge_pixels() {
        let pixel = |i: u8| {
            [
                i.wrapping_mul(91),
                i.wrapping_mul(57),
                i.wrapping_mul(143),
                i,
            ]
        };
        let chroma = Chroma {
            halved: true,
            full: false,
        };
        for [width, height] in [[3, 3], [4, 2], [2, 5], [1, 1], [5, 4]] {
            let pixels: Vec<_> = (0..width * height).map(|i| pixel(i as u8)).collect();
            let mut planes = Planes::default();
            planes.set(&pixels, width, chroma);
            let half = width.div_ceil(2);
            let [cb, cr] = &planes.halved;
            assert_eq!([cb.len(), cr.len()], [half * height.div_ceil(2); 2]);
            for (i, (cb, cr)) in cb.iter().zip(cr).enumerate() {
                let places = [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[x, y]| {
                    let x = (i % half * 2 + x).min(width - 1);
                    (i / half * 2 + y).min(height - 1) * width + x
                });
                let channel = |c| places.map(|p| f64::from(pixels[p][c])).iter().sum::<f64>() / 4.0;
                let [_, exact_cb, exact_cr] = exact([0, 1, 2].map(channel));
                assert_near(*cb, exact_cb);
                assert_near(*cr, exact_cr);
            }
        }
        Planes::default().set(&[], 0, chroma);
    }

    #[test]
    fn luma_and_chroma_round_to_nearest() {
        // Every third value per channel, including 0 and 255.
        let axis = || (0..=255_u8).step_by(3);
        let all = axis().flat_map(|r| axis().flat_map(move |g| axis().map(move |b| [r, g, b, 7])));
        let all: Vec<[u8; 4]> = all.collect();
        let mut planes = Planes::default();
        planes.set(
            &all,
            all.len(),
            Chroma {
                halved: false,
                full: true,
            },
        );
        let [cb, cr] = &planes.full;
        for (i, &[r, g, b, _]) in all.iter().enumerate() {
            let exact = exact([r, g, b].map(f64::from));
            for (value, exact) in [planes.luma[i], cb[i], cr[i]].into_iter().zip(exact) {
                assert_near(value, exact);
            }
        }
    }
}
