//! Hit files: `.npz` archives of NumPy arrays.
//!
//! Arrays are stored without compression. The fastest deflate level shrinks a frame of 1280x720 from 15.7 to 4.7 MB,
//! but takes 0.4 s on one core, as long as tracing the frame. Entries have the format's earliest date, so that equal
//! hits produce equal files.

use crate::OutputError;
use crate::atomic::write_whole;
use geom::Hit;
use npyz::{AutoSerialize, WriteOptions, WriterBuilder};
use std::io::{self, BufWriter, Cursor, Write};
use std::path::Path;
use zip::write::{FileOptions, ZipWriter};
use zip::{CompressionMethod, DateTime};

/// Upper bound of the bytes for the headers of all arrays and the archive's directory.
const MAX_HEADER_BYTES: usize = 4096;

/// Contents of a hit file: closest hits of a list of rays or of a camera's rays, with optional shadows and an offset.
#[derive(Clone, Copy, Debug)]
pub struct HitArrays<'a> {
    /// `[height, width]`, or `[rays]`.
    pub shape: &'a [u64],
    /// One hit per ray, row by row.
    pub hits: &'a [Hit],
    /// 1 for rays whose hit is in shadow. `None` without shadow rays.
    pub shadow: Option<&'a [u8]>,
    /// Point that was subtracted from the scene's coordinates.
    pub offset: Option<[f64; 3]>,
}

impl<'a> HitArrays<'a> {
    /// Creates arrays without shadows and without an offset.
    #[must_use]
    pub fn of(hits: &'a [Hit], shape: &'a [u64]) -> Self {
        Self {
            shape,
            hits,
            shadow: None,
            offset: None,
        }
    }

    /// Writes the arrays `triangle` u32 (4294967295 = miss) and `t`, `u`, `v` f32 (miss: inf, 0, 0) of the given shape.
    /// The optional arrays `shadow` u8 of the same shape and `offset` f64 (3,) follow.
    ///
    /// # Errors
    /// If the file cannot be written, or if the lengths do not match the shape.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        let (hits, shape) = (self.hits.iter(), self.shape);
        write_archive(path, 17 * hits.len(), |zip| {
            add(zip, shape, "triangle", hits.clone().map(|h| h.triangle))?;
            add(zip, shape, "t", hits.clone().map(|h| h.t))?;
            add(zip, shape, "u", hits.clone().map(|h| h.u))?;
            add(zip, shape, "v", hits.clone().map(|h| h.v))?;
            if let Some(shadow) = self.shadow {
                add(zip, shape, "shadow", shadow.iter().copied())?;
            }
            let offset = self.offset;
            offset.map_or(Ok(()), |o| add(zip, &[3], "offset", o.into_iter()))
        })
    }
}

/// Writes the single array `hit` u8 of shape (N,): 1 for rays that hit any triangle.
pub fn write_any_hits(path: &Path, found: &[u8]) -> Result<(), OutputError> {
    write_archive(path, found.len(), |zip| {
        add(zip, &[found.len() as u64], "hit", found.iter().copied())
    })
}

type Archive = ZipWriter<Cursor<Vec<u8>>>;

/// Writes an archive of about `bytes` bytes. Builds it in memory first, because a `ZipWriter` whose output fails
/// prints to standard error when dropped.
fn write_archive(
    path: &Path,
    bytes: usize,
    fill: impl FnOnce(&mut Archive) -> io::Result<()>,
) -> Result<(), OutputError> {
    let buffer = Vec::with_capacity(bytes + MAX_HEADER_BYTES);
    let mut zip = ZipWriter::new(Cursor::new(buffer));
    let filled = fill(&mut zip).and_then(|()| Ok(zip.finish()?.into_inner()));
    write_whole(path, &filled.map_err(|e| OutputError::writing(path, e))?)
}

/// Adds an array to an archive.
fn add<T: AutoSerialize>(
    zip: &mut Archive,
    shape: &[u64],
    name: &str,
    values: impl ExactSizeIterator<Item = T>,
) -> io::Result<()> {
    let count = values.len() as u64;
    let bytes = count * size_of::<T>() as u64;
    let options = FileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(DateTime::default())
        .large_file(bytes >= u64::from(u32::MAX) - (1 << 16));
    zip.start_file(format!("{name}.npy"), options)?;
    // Buffers the numbers, because the archive updates its checksum on every write.
    let mut out = BufWriter::with_capacity(1 << 16, zip);
    let npy = WriteOptions::new().default_dtype().shape(shape);
    let mut npy = npy.writer(&mut out).begin_nd()?;
    npy.extend(values)?;
    npy.finish()?;
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};
    use zip::ZipArchive;

    fn hits() -> Vec<Hit> {
        let hit = |i: u32| Hit {
            t: 0.5 + i as f32,
            u: 0.25,
            v: 0.125,
            triangle: i,
        };
        vec![hit(0), Hit::MISS, hit(7), hit(3), Hit::MISS, hit(1)]
    }

    fn read<T: npyz::Deserialize>(path: &Path, name: &str) -> (Vec<u64>, String, Vec<T>) {
        let mut archive = ZipArchive::new(File::open(path).unwrap()).unwrap();
        let file = archive.by_name(&format!("{name}.npy")).unwrap();
        let array = npyz::NpyFile::new(file).unwrap();
        let (shape, dtype) = (array.shape().to_vec(), array.dtype().descr());
        (shape, dtype, array.into_vec().unwrap())
    }

    #[test]
    fn hit_arrays_round_trip() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("hits_0000.npz");
        let hits = hits();
        let shadow = [1, 0, 0, 0, 0, 1];
        let mut arrays = HitArrays {
            shadow: Some(&shadow),
            offset: Some([0.5, 1e300, -0.1]),
            ..HitArrays::of(&hits, &[2, 3])
        };
        arrays.write(&path).unwrap();
        let (shape, dtype, triangle) = read::<u32>(&path, "triangle");
        assert_eq!((shape, dtype.as_str()), (vec![2, 3], "'<u4'"));
        assert_eq!(triangle, [0, 4_294_967_295, 7, 3, 4_294_967_295, 1]);
        for (name, expected) in [
            ("t", [0.5, f32::INFINITY, 7.5, 3.5, f32::INFINITY, 1.5]),
            ("u", [0.25, 0.0, 0.25, 0.25, 0.0, 0.25]),
            ("v", [0.125, 0.0, 0.125, 0.125, 0.0, 0.125]),
        ] {
            let (_, dtype, values) = read::<f32>(&path, name);
            assert_eq!((dtype.as_str(), &values[..]), ("'<f4'", &expected[..]));
        }
        let (shape, dtype, read_shadow) = read::<u8>(&path, "shadow");
        assert_eq!((shape, dtype.as_str()), (vec![2, 3], "'|u1'"));
        assert_eq!(read_shadow, shadow);
        let (shape, dtype, offset) = read::<f64>(&path, "offset");
        assert_eq!((shape, dtype.as_str()), (vec![3], "'<f8'"));
        assert_eq!(offset, [0.5, 1e300, -0.1]);
        arrays.shadow = Some(&[1, 0]);
        let mismatch = arrays.write(&path).unwrap_err().to_string();
        assert!(mismatch.contains("shape"), "{mismatch}");
    }

    #[test]
    fn hit_files_are_reproducible() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npz");
        let names = || {
            let archive = ZipArchive::new(File::open(&path).unwrap()).unwrap();
            let mut names: Vec<_> = archive.file_names().map(str::to_owned).collect();
            names.sort_unstable();
            names.join(" ")
        };
        HitArrays::of(&hits(), &[6]).write(&path).unwrap();
        assert_eq!(names(), "t.npy triangle.npy u.npy v.npy");
        let bytes = fs::read(&path).unwrap();
        // Bytes 10..14 of a local file header are time and date. 1980-01-01 00:00 is (0, 0x0021).
        assert_eq!(bytes[10..14], [0, 0, 0x21, 0]);
        HitArrays::of(&hits(), &[6]).write(&path).unwrap();
        let again = fs::read(&path).unwrap();
        assert_eq!(again, bytes, "equal hits are equal files");
        write_any_hits(&path, &[1, 0, 1]).unwrap();
        assert_eq!(names(), "hit.npy");
        assert_eq!(read::<u8>(&path, "hit").2, [1, 0, 1]);
    }
}
