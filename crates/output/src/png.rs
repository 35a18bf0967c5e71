//! Pictures as `.png` files.

use crate::WriteError;
use crate::atomic::write_with;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};
use std::io;
use std::path::Path;

/// Writes 8-bit sRGB pixels, three bytes each, row 0 at the top.
///
/// # Errors
/// [`WriteError`]; `path` then holds what it held before.
///
/// # Panics
/// If `rgb` does not hold `3 * width * height` bytes.
pub fn write_png(path: &Path, [width, height]: [u32; 2], rgb: &[u8]) -> Result<(), WriteError> {
    write_with(path, |out| {
        PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Adaptive)
            .write_image(rgb, width, height, ExtendedColorType::Rgb8)
            .map_err(|e| match e {
                ImageError::IoError(e) => e,
                other => io::Error::other(other),
            })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_reads_back_as_it_was() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let rgb: Vec<u8> = (0..5 * 3 * 3).map(|i| (i * 5) as u8).collect();
        write_png(&path, [5, 3], &rgb).unwrap();
        let read = image::open(&path).unwrap().into_rgb8();
        assert_eq!((read.width(), read.height()), (5, 3));
        assert_eq!(read.into_raw(), rgb);
    }
}
