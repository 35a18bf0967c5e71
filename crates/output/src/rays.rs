//! Ray files: `.npy` arrays of f32 or f64. The shape is (N, 6) for `ox oy oz dx dy dz`, or (N, 8) with `t_min t_max`
//! appended.

use crate::atomic::{OutputError, write_with};
use geom::Ray;
use npyz::{
    AutoSerialize, DType, NpyFile, NpyHeader, Order, TypeChar, WriteOptions, WriterBuilder,
};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// Maximum header size in bytes. A header for a two-dimensional array takes about 100 bytes.
const MAX_HEADER: u32 = 4096;

/// Open file of rays with a checked header.
pub struct RayFile {
    path: PathBuf,
    header: NpyHeader,
    reader: BufReader<File>,
    rays: usize,
    columns: usize,
    /// Size of a number in bytes: 4 or 8.
    number_bytes: usize,
}

impl RayFile {
    /// Opens a file of either byte order, in C or Fortran order.
    ///
    /// # Errors
    /// If the file cannot be read or is no array of rays. The message names the found and the expected format.
    pub fn open(path: &Path) -> Result<Self, OutputError> {
        let name = path.display();
        let unreadable = |cause| OutputError::reading(path, cause);
        let refused = |reason| OutputError(format!("{name}: {reason}"));
        let file = host::open(path).map_err(unreadable)?;
        let mut reader = BufReader::with_capacity(1 << 18, file);
        let first_bytes = reader.fill_buf().map_err(unreadable)?;
        host::reject_lfs_pointer(first_bytes).map_err(unreadable)?;
        let no_array = |reason| refused(format!("not a .npy array: {reason}"));
        let (header, header_bytes) = read_header(&mut reader).map_err(no_array)?;
        let (number_bytes, [rays, columns]) = check(&header).map_err(refused)?;
        let size = reader.get_ref().metadata().map_err(unreadable)?.len();
        let found = size.saturating_sub(header_bytes);
        let wanted = u128::from(rays) * u128::from(columns) * u128::from(number_bytes);
        if wanted > u128::from(found) {
            let shape = shape_text(header.shape());
            let says = format!("truncated: shape {shape} takes {wanted} bytes of data");
            return Err(refused(format!("{says}, found {found}")));
        }
        Ok(Self {
            path: path.to_owned(),
            header,
            reader,
            rays: rays as usize,
            columns: columns as usize,
            number_bytes: number_bytes as usize,
        })
    }

    /// Returns the number of rays.
    #[must_use]
    pub fn count(&self) -> usize {
        self.rays
    }

    /// Reads the rays. `offset` is subtracted from the origins in double precision, before all numbers are rounded to
    /// single precision.
    ///
    /// Without `t_min t_max`, rays cover `(0, inf)`. Non-finite numbers are kept, because such rays miss (see
    /// [`Ray::is_valid`]).
    ///
    /// # Errors
    /// If the file cannot be read or the rays do not fit into memory.
    pub fn read(self, offset: [f64; 3]) -> Result<Vec<Ray>, OutputError> {
        let unreadable = |cause| OutputError::reading(&self.path, cause);
        // The list of numbers grows by doubling. `open` has checked that the file contains all numbers, so the product
        // cannot overflow.
        let values = (self.rays * self.columns).next_power_of_two() * self.number_bytes;
        let bytes = values.saturating_add(self.rays.saturating_mul(size_of::<Ray>()));
        let checked = host::check_memory(bytes as u64);
        checked.map_err(|e| unreadable(io::Error::new(io::ErrorKind::OutOfMemory, e)))?;
        let (shape, order) = ([self.rays, self.columns], self.header.order());
        let file = NpyFile::with_header(self.header, self.reader);
        let rays = if self.number_bytes == 4 {
            let values = file.into_vec::<f32>();
            values.map(|values| rays_of(&values, shape, order, offset))
        } else {
            let values = file.into_vec::<f64>();
            values.map(|values| rays_of(&values, shape, order, offset))
        };
        rays.map_err(unreadable)
    }
}

/// Writes `count` rays in C order, as (N, 6) if all cover `(0, inf)`, else as (N, 8). The numbers are little-endian
/// f32, or f64 with the `offset` added to the origins.
///
/// # Errors
/// If the file cannot be written.
pub fn write_rays(
    path: &Path,
    count: usize,
    rays: impl Iterator<Item = Ray> + Clone,
    offset: Option<[f64; 3]>,
) -> Result<(), OutputError> {
    let is_whole = |r: Ray| r.t_min == 0.0 && r.t_max == f32::INFINITY;
    let columns = if rays.clone().all(is_whole) { 6 } else { 8 };
    let row = |r: Ray| {
        let [o, d] = [r.origin, r.direction];
        [o[0], o[1], o[2], d[0], d[1], d[2], r.t_min, r.t_max]
    };
    let shape = [count as u64, columns];
    let columns = columns as usize;
    write_with(path, |out| match offset {
        None => {
            let numbers = rays.flat_map(|r| row(r).into_iter().take(columns));
            write_numbers(out, &shape, numbers)
        }
        Some(offset) => {
            let moved = |r: Ray| {
                let mut row = row(r).map(f64::from);
                (0..3).for_each(|i| row[i] += offset[i]);
                row.into_iter().take(columns)
            };
            write_numbers(out, &shape, rays.flat_map(moved))
        }
    })
}

fn write_numbers<T: AutoSerialize>(
    out: &mut dyn Write,
    shape: &[u64],
    numbers: impl Iterator<Item = T>,
) -> io::Result<()> {
    let npy = WriteOptions::new().default_dtype().shape(shape);
    let mut npy = npy.writer(out).begin_nd()?;
    npy.extend(numbers)?;
    npy.finish()
}

/// Reads the header and returns it with its length in bytes. The checks keep malicious headers from causing stack
/// overflows, large allocations or panics.
fn read_header(reader: &mut impl Read) -> Result<(NpyHeader, u64), String> {
    let ended = |_| "the file ends within its header";
    let mut bytes = vec![0; 8];
    reader.read_exact(&mut bytes).map_err(ended)?;
    if bytes[..6] != *b"\x93NUMPY" {
        return Err("it does not begin with the bytes \\x93NUMPY".to_owned());
    }
    let width = if bytes[6] == 1 { 2 } else { 4 };
    let mut length = [0; 4];
    reader.read_exact(&mut length[..width]).map_err(ended)?;
    bytes.extend_from_slice(&length[..width]);
    let length = u32::from_le_bytes(length);
    if length > MAX_HEADER {
        return Err(format!("its header of {length} bytes is too long for rays"));
    }
    let start = bytes.len();
    bytes.resize(start + length as usize, 0);
    reader.read_exact(&mut bytes[start..]).map_err(ended)?;
    if shape_digits(&bytes[start..]) > 19 {
        return Err("its header describes an array too large to exist".to_owned());
    }
    // After its message, the parser appends several lines that mark the location of the error.
    let first_words = |e: io::Error| match e.to_string().split_once("-->") {
        Some((words, _)) => words.trim().to_owned(),
        None => e.to_string(),
    };
    let header = NpyHeader::from_reader(&bytes[..]).map_err(first_words)?;
    Ok((header, bytes.len() as u64))
}

/// Counts the digits between the key `shape` and the end of its tuple. If all numbers together have `n` digits, their
/// product is below `10^n`. With at most 19 digits it fits into a `u64`, which `npyz` assumes.
fn shape_digits(header: &[u8]) -> usize {
    let text = String::from_utf8_lossy(header);
    let (_, after) = text.split_once("shape").unwrap_or(("", &text));
    let tuple = after.split([')', ']']).next().unwrap_or("");
    tuple.bytes().filter(u8::is_ascii_digit).count()
}

/// Returns the size of a number in bytes, 4 or 8, and the numbers of rays and columns.
fn check(header: &NpyHeader) -> Result<(u64, [u64; 2]), String> {
    let dtype = header.dtype();
    let bytes = match &dtype {
        DType::Plain(t) if t.type_char() == TypeChar::Float => t.size_field(),
        _ => 0,
    };
    if !matches!(bytes, 4 | 8) {
        let (found, says) = (dtype.descr(), "rays must be float32 or float64, found");
        return Err(format!("{says} {found}"));
    }
    match *header.shape() {
        [rays, columns @ (6 | 8)] => Ok((bytes, [rays, columns])),
        ref other => {
            let says = "rays must have shape (N, 6) or (N, 8), found";
            Err(format!("{says} {}", shape_text(other)))
        }
    }
}

/// Converts the numbers of a file, in its order, to rays. Subtracts `offset` from the origins.
fn rays_of<T: Copy + Into<f64>>(
    values: &[T],
    [rays, columns]: [usize; 2],
    order: Order,
    offset: [f64; 3],
) -> Vec<Ray> {
    let at = |ray: usize, column: usize| -> f64 {
        let index = match order {
            Order::C => ray * columns + column,
            Order::Fortran => column * rays + ray,
        };
        values[index].into()
    };
    let ray = |i| {
        let origin = std::array::from_fn(|c| (at(i, c) - offset[c]) as f32);
        let direction = std::array::from_fn(|c| at(i, 3 + c) as f32);
        let mut ray = Ray::new(origin, direction);
        if columns == 8 {
            (ray.t_min, ray.t_max) = (at(i, 6) as f32, at(i, 7) as f32);
        }
        ray
    };
    (0..rays).map(ray).collect()
}

/// Formats a shape in Python syntax.
fn shape_text(shape: &[u64]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("{shape:?}").replace('[', "(").replace(']', ")"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use tempfile::TempDir;

    fn rays(n: usize) -> Vec<Ray> {
        let ray = |i| {
            let x = i as f32;
            // Rays with non-finite numbers are read too, because they miss.
            let far = if i == 3 { f32::INFINITY } else { 1e-40 };
            Ray::new([x, x + 0.1, x + 0.2], [x + 0.3, -x, far])
        };
        (0..n).map(ray).collect()
    }

    /// Returns a `.npy` file, version 1, with the given header and data.
    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn header(descr: &str, fortran: &str, shape: &str) -> String {
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
    }

    fn read(bytes: &[u8]) -> Result<Vec<Ray>, String> {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("rays.npy");
        fs::write(&path, bytes).unwrap();
        let text = |e: OutputError| {
            let text = e.to_string();
            assert!(text.contains("rays.npy") && !text.contains('\n'), "{text}");
            text
        };
        let file = RayFile::open(&path).map_err(text)?;
        file.read([0.0; 3]).map_err(text)
    }

    fn refused(bytes: &[u8], because: &[&str]) {
        let text = read(bytes).unwrap_err();
        for part in because {
            assert!(text.contains(part), "'{text}' lacks '{part}'");
        }
    }

    #[test]
    fn ray_files_round_trip() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("rays.npy");
        for mut rays in [rays(0), rays(5), rays(1)] {
            for limits in [(0.0, f32::INFINITY), (0.25, 4.0)] {
                rays.iter_mut()
                    .for_each(|ray| (ray.t_min, ray.t_max) = limits);
                write_rays(&path, rays.len(), rays.iter().copied(), None).unwrap();
                let file = RayFile::open(&path).unwrap();
                assert_eq!(file.count(), rays.len());
                assert_eq!(file.read([0.0; 3]).unwrap(), rays);
            }
        }
    }

    #[test]
    fn reads_any_byte_and_axis_order() {
        let want = rays(3);
        let row = |r: &Ray| [r.origin, r.direction].concat();
        let table: Vec<Vec<f32>> = want.iter().map(row).collect();
        let by_column = || (0..6).flat_map(|c| table.iter().map(move |row| row[c]));
        let little: Vec<u8> = by_column().flat_map(f32::to_le_bytes).collect();
        let by_row = table.iter().flatten();
        let big: Vec<u8> = by_row.flat_map(|x| x.to_be_bytes()).collect();
        for (descr, fortran, data) in [("<f4", "True", little), (">f4", "False", big)] {
            let file = npy(&header(descr, fortran, "(3, 6)"), &data);
            assert_eq!(read(&file).unwrap(), want);
        }
    }

    #[test]
    fn offsets_are_subtracted_in_double_precision() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("rays.npy");
        let offset = [691_608.65, 5_334_760.25, -1e9];
        let want = rays(6);
        write_rays(&path, 6, want.iter().copied(), Some(offset)).unwrap();
        let file = RayFile::open(&path).unwrap();
        for (found, want) in file.read(offset).unwrap().iter().zip(&want) {
            let off = |i: usize| (found.origin[i] - want.origin[i]).abs();
            assert!((0..3).all(|i| off(i) < 1e-6), "{found:?} is not {want:?}");
            assert_eq!(found.direction, want.direction);
        }
        let ray = [
            offset[0] + 0.125,
            offset[1] - 80.0,
            offset[2],
            0.0,
            0.0,
            1.0,
            0.5,
            2.0,
        ];
        for (descr, bytes) in [
            ("<f8", ray.map(f64::to_le_bytes)),
            (">f8", ray.map(f64::to_be_bytes)),
        ] {
            let file = npy(&header(descr, "False", "(1, 8)"), bytes.as_flattened());
            fs::write(&path, file).unwrap();
            let found = RayFile::open(&path).unwrap().read(offset).unwrap()[0];
            assert_eq!(found.origin, [0.125, -80.0, 0.0]);
            assert_eq!(
                (found.direction, found.t_min, found.t_max),
                ([0.0, 0.0, 1.0], 0.5, 2.0)
            );
        }
    }

    #[test]
    fn errors_name_wrong_type_or_shape() {
        let data = [0; 64];
        for (descr, says) in [("<f2", "'<f2'"), ("<i4", "'<i4'"), ("|O", "found")] {
            let file = npy(&header(descr, "False", "(1, 6)"), &data);
            refused(&file, &["float32", says]);
        }
        let record = "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1, 6)}";
        refused(&npy(record, &data), &["float32"]);
        for shape in ["(6,)", "(2, 7)", "(1, 2, 3)", "()", "(6, 2)"] {
            let file = npy(&header("<f4", "False", shape), &data);
            refused(&file, &["(N, 6) or (N, 8)", shape]);
        }
    }

    #[test]
    fn truncated_files_are_rejected() {
        let whole = npy(&header("<f4", "False", "(2, 6)"), &[0; 48]);
        assert!(read(&whole).is_ok());
        for end in 0..whole.len() {
            read(&whole[..end]).unwrap_err();
        }
        refused(&whole[..whole.len() - 1], &["truncated", "48", "47"]);
    }

    #[test]
    fn hostile_headers_neither_panic_nor_allocate() {
        let many = format!("({}6)", "99, ".repeat(20));
        for (shape, says) in [
            ("(4294967296, 4294967296)", "too large"),
            (&many, "too large"),
            ("(999999999999, 6)", "truncated"),
        ] {
            refused(&npy(&header("<f4", "False", shape), &[]), &[says]);
        }
        let [deep, deeper] = [4000, 60_000].map(|n| npy(&"(".repeat(n), &[]));
        let other = b"\x93NUMPY\x09\x00\x02\x00\x00\x00{}";
        for file in [&deep[..], &deeper, b"", other, b"ox oy oz\n0 0 0\n"] {
            refused(file, &["not a .npy array"]);
        }
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n";
        refused(pointer, &["Git LFS pointer"]);
    }
}
