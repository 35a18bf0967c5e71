//! Pictures of frames.

use crate::{OutputError, write_with};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};
use std::io;
use std::path::Path;

/// Fills `rgb` with the first three bytes of every four bytes in `rgba`.
pub fn drop_alpha(rgba: &[u8], rgb: &mut Vec<u8>) {
    rgb.resize(rgba.len() / 4 * 3, 0);
    let pixels = rgb.as_chunks_mut::<3>().0.iter_mut();
    for (to, &[r, g, b, _]) in pixels.zip(rgba.as_chunks::<4>().0) {
        *to = [r, g, b];
    }
}

/// Writes 8-bit sRGB pixels as PNG. Pixels have three bytes each, with row 0 at the top.
///
/// # Panics
/// If `rgb` does not contain `3 * width * height` bytes.
pub fn write_png(path: &Path, [width, height]: [u32; 2], rgb: &[u8]) -> Result<(), OutputError> {
    write_with(path, |out| {
        PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Adaptive)
            .write_image(rgb, width, height, ExtendedColorType::Rgb8)
            .map_err(|e| match e {
                ImageError::IoError(e) => e,
                other => io::Error::other(other),
            })
    })
}
