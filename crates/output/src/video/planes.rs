//! A frame as videos hold it: luma and chroma, of BT.601 in its limited range, which readers of the format take them for.

/// Luma and chroma of a frame, at full size (4:4:4) and with chroma at half of it along both axes (4:2:0).
#[derive(Clone, Debug, Default)]
pub struct Planes {
    /// Y', Cb, Cr.
    full: [Vec<u8>; 3],
    /// Cb, Cr.
    halves: [Vec<u8>; 2],
}

impl Planes {
    /// Takes sRGB pixels (the fourth byte says nothing), in rows of so many. Works on the calling thread alone: there are
    /// other frames.
    pub fn set(&mut self, pixels: &[[u8; 4]], width: usize) {
        separate(pixels, &mut self.full);
        for (full, half) in self.full[1..].iter().zip(&mut self.halves) {
            halve((full, width), half);
        }
    }

    /// 4:2:0 if `halved`, else 4:4:4.
    pub(super) fn frame(&self, halved: bool) -> y4m::Frame<'_> {
        let [y, cb, cr] = &self.full;
        let [half_cb, half_cr] = &self.halves;
        match halved {
            true => y4m::Frame::new([y, half_cb, half_cr], None),
            false => y4m::Frame::new([y, cb, cr], None),
        }
    }
}

/// Means of two by two samples; at an odd edge, of those that are there twice.
fn halve((plane, width): (&[u8], usize), to: &mut Vec<u8>) {
    let (width, half) = (width.max(1), width.div_ceil(2).max(1));
    to.resize(half * (plane.len() / width).div_ceil(2), 0);
    for (rows, to) in plane.chunks(2 * width).zip(to.chunks_mut(half)) {
        let (upper, lower) = rows.split_at(width);
        let lower = if lower.is_empty() { upper } else { lower };
        let pairs = upper.chunks(2).zip(lower.chunks(2));
        for ((upper, lower), to) in pairs.zip(to) {
            let both = |row: &[u8]| u16::from(row[0]) + u16::from(row[row.len() - 1]);
            *to = ((both(upper) + both(lower) + 2) / 4) as u8;
        }
    }
}

/// Pixels that are worked on at a time: their channels stay in the nearest cache.
const BLOCK: usize = 64;

fn separate(pixels: &[[u8; 4]], planes: &mut [Vec<u8>; 3]) {
    for plane in &mut *planes {
        plane.resize(pixels.len(), 0);
    }
    let [y, cb, cr] = planes.each_mut().map(|plane| plane.chunks_mut(BLOCK));
    for (pixels, ((y, cb), cr)) in pixels.chunks(BLOCK).zip(y.zip(cb).zip(cr)) {
        let mut channels = [[0; BLOCK]; 3];
        for (channel, values) in channels.iter_mut().enumerate() {
            for (pixel, value) in pixels.iter().zip(values) {
                *value = u16::from(pixel[channel]) << 8;
            }
        }
        let [r, g, b] = &channels;
        let all = r.iter().zip(g).zip(b);
        for (((&r, &g), &b), ((y, cb), cr)) in all.zip(y.iter_mut().zip(cb).zip(cr)) {
            [*y, *cb, *cr] = ycbcr([r, g, b]);
        }
    }
}

/// sRGB to Y'CbCr of BT.601 in its limited range, the nearest; both in 256ths. In numbers of 16 bits, of which processors
/// multiply many at once.
#[inline(always)]
fn ycbcr([r, g, b]: [u16; 3]) -> [u8; 3] {
    // Each product is cut off: by a half of a 256th, at a mean.
    let part = |x: u16, k: u32| ((u32::from(x) * k) >> 16) as u16;
    let y = part(r, 16_829) + part(g, 33_039) + part(b, 6_416) + ((16 << 8) + 129);
    let cb = ((128 << 8) + 127) + part(b, 28_784) - part(r, 9_714) - part(g, 19_070);
    let cr = ((128 << 8) + 127) + part(r, 28_784) - part(g, 24_103) - part(b, 4_681);
    [y, cb, cr].map(|value| (value >> 8) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chroma_is_halved_along_both_axes_and_edges_count_twice() {
        let mut halves = Vec::new();
        halve((&[0, 4, 8, 4, 9, 10, 20, 22, 30], 3), &mut halves);
        assert_eq!(halves, [4, 9, 21, 30]);
        halve((&[1, 3, 5, 7], 2), &mut halves);
        assert_eq!(halves, [4]);
        halve((&[], 2), &mut halves);
        assert_eq!(halves, [0; 0]);
    }

    #[test]
    fn luma_and_chroma_are_the_nearest() {
        // Every third colour, and all ends.
        let axis = || (0..=255_u8).step_by(3);
        let all = axis().flat_map(|r| axis().flat_map(move |g| axis().map(move |b| [r, g, b, 7])));
        let all: Vec<[u8; 4]> = all.collect();
        let mut planes = Planes::default();
        planes.set(&all, all.len());
        for (i, rgb) in all.iter().enumerate() {
            let [r, g, b, _] = rgb.map(|x| f64::from(x) / 255.0);
            let exact = [
                16.0 + 65.481 * r + 128.553 * g + 24.966 * b,
                128.0 - 37.797 * r - 74.203 * g + 112.0 * b,
                128.0 + 112.0 * r - 93.786 * g - 18.214 * b,
            ];
            for (plane, exact) in planes.full.iter().zip(exact) {
                let off = (f64::from(plane[i]) - exact).abs();
                assert!(off < 0.51, "{rgb:?}: {} for {exact}", plane[i]);
            }
        }
    }
}
