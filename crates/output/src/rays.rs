//! Rays as `.npy` arrays: f32 (N, 6) `ox oy oz dx dy dz`, or (N, 8) with `t_min t_max` appended.

use crate::atomic::{OutputError, write_with};
use geom::Ray;
use npyz::{DType, NpyFile, NpyHeader, Order, TypeChar, WriteOptions, WriterBuilder};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// A header of two dimensions and one type takes about a hundred bytes; longer ones are no rays.
const MAX_HEADER: u32 = 4096;

/// Reads rays of either byte order, in C or Fortran order. Without `t_min t_max` a ray covers `(0, inf)`. Numbers that are
/// not finite are kept: such rays miss (see [`Ray::is_valid`]). An error says what was found and what is wanted.
pub fn read_rays(path: &Path) -> Result<Vec<Ray>, OutputError> {
    let name = path.display();
    let unreadable = |cause| OutputError::reading(path, cause);
    let refused = |reason| OutputError(format!("{name}: {reason}"));
    let file = host::open(path).map_err(unreadable)?;
    let mut reader = BufReader::with_capacity(1 << 18, file);
    let first_bytes = reader.fill_buf().map_err(unreadable)?;
    host::refuse_pointer(first_bytes).map_err(unreadable)?;
    let no_array = |reason| refused(format!("not a .npy array: {reason}"));
    let (header, header_bytes) = read_header(&mut reader).map_err(no_array)?;
    let (rays, columns) = check(&header).map_err(refused)?;
    let size = reader.get_ref().metadata().map_err(unreadable)?.len();
    let found = size.saturating_sub(header_bytes);
    let wanted = u128::from(rays) * u128::from(columns) * 4;
    if wanted > u128::from(found) {
        let shape = shape_text(header.shape());
        let says = format!("truncated: shape {shape} takes {wanted} bytes of data");
        return Err(refused(format!("{says}, found {found}")));
    }
    // Numbers are read into a list that grows by doubling. There are no more than the file has bytes.
    let values = (rays * columns).next_power_of_two() * size_of::<f32>() as u64;
    let bytes = values.saturating_add(rays.saturating_mul(size_of::<Ray>() as u64));
    host::check(bytes).map_err(|e| unreadable(io::Error::new(io::ErrorKind::OutOfMemory, e)))?;
    let values = NpyFile::with_header(header.clone(), reader).into_vec::<f32>();
    let values = values.map_err(unreadable)?;
    Ok(to_rays(&values, columns as usize, header.order()))
}

/// Writes so many rays as little-endian f32 in C order, (N, 6) if all cover `(0, inf)`, else (N, 8).
pub fn write_rays(
    path: &Path,
    count: usize,
    rays: impl Iterator<Item = Ray> + Clone,
) -> Result<(), OutputError> {
    let is_whole = |r: Ray| r.t_min == 0.0 && r.t_max == f32::INFINITY;
    let columns = if rays.clone().all(is_whole) { 6 } else { 8 };
    write_with(path, |out| {
        let mut npy = WriteOptions::new()
            .default_dtype()
            .shape(&[count as u64, columns])
            .writer(out)
            .begin_nd()?;
        for r in rays {
            let [o, d] = [r.origin, r.direction];
            let row = [o[0], o[1], o[2], d[0], d[1], d[2], r.t_min, r.t_max];
            npy.extend(row[..columns as usize].iter().copied())?;
        }
        npy.finish()
    })
}

/// The header and its length in bytes, after checks that keep a hostile one from costing stack, memory or a panic.
fn read_header(reader: &mut impl Read) -> Result<(NpyHeader, u64), String> {
    let ended = |_| "the file ends within its header";
    let mut bytes = vec![0; 8];
    reader.read_exact(&mut bytes).map_err(ended)?;
    if bytes[..6] != *b"\x93NUMPY" {
        return Err("it does not begin with the magic \\x93NUMPY".to_owned());
    }
    let width = if bytes[6] == 1 { 2 } else { 4 };
    let mut length = [0; 4];
    reader.read_exact(&mut length[..width]).map_err(ended)?;
    bytes.extend_from_slice(&length[..width]);
    let length = u32::from_le_bytes(length);
    if length > MAX_HEADER {
        return Err(format!("its header of {length} bytes describes no rays"));
    }
    let start = bytes.len();
    bytes.resize(start + length as usize, 0);
    reader.read_exact(&mut bytes[start..]).map_err(ended)?;
    if shape_digits(&bytes[start..]) > 19 {
        return Err("its header describes an array too large to exist".to_owned());
    }
    // The parser draws a picture of the place below its first words.
    let first_words = |e: io::Error| match e.to_string().split_once("-->") {
        Some((words, _)) => words.trim().to_owned(),
        None => e.to_string(),
    };
    let header = NpyHeader::from_reader(&bytes[..]).map_err(first_words)?;
    Ok((header, bytes.len() as u64))
}

/// Digits after the key `shape`, up to the end of its tuple. The product of numbers with `n` digits in all is below `10^n`;
/// up to 19 it fits u64, which `npyz` takes for granted.
fn shape_digits(header: &[u8]) -> usize {
    let text = String::from_utf8_lossy(header);
    let (_, after) = text.split_once("shape").unwrap_or(("", &text));
    let tuple = after.split([')', ']']).next().unwrap_or("");
    tuple.bytes().filter(u8::is_ascii_digit).count()
}

/// Rays and columns.
fn check(header: &NpyHeader) -> Result<(u64, u64), String> {
    let dtype = header.dtype();
    let float_bytes = match &dtype {
        DType::Plain(t) if t.type_char() == TypeChar::Float => t.size_field(),
        _ => 0,
    };
    if float_bytes != 4 {
        let (found, convert) = (dtype.descr(), "; convert with rays.astype('float32')");
        let hint = if float_bytes == 8 { convert } else { "" };
        let says = "rays must be float32 ('<f4' or '>f4'), found";
        return Err(format!("{says} {found}{hint}"));
    }
    match *header.shape() {
        [rays, columns @ (6 | 8)] => Ok((rays, columns)),
        ref other => {
            let says = "rays must have shape (N, 6) or (N, 8), found";
            Err(format!("{says} {}", shape_text(other)))
        }
    }
}

fn to_rays(values: &[f32], columns: usize, order: Order) -> Vec<Ray> {
    let rays = values.len() / columns;
    let at = |ray: usize, column: usize| match order {
        Order::C => values[ray * columns + column],
        Order::Fortran => values[column * rays + ray],
    };
    let ray = |i| {
        let from = |first| std::array::from_fn(|c| at(i, first + c));
        let mut ray = Ray::new(from(0), from(3));
        if columns == 8 {
            (ray.t_min, ray.t_max) = (at(i, 6), at(i, 7));
        }
        ray
    };
    (0..rays).map(ray).collect()
}

/// A shape as Python writes it.
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
            // Those that mean nothing are read, too: they miss.
            let far = if i == 3 { f32::INFINITY } else { 1e-40 };
            Ray::new([x, x + 0.1, x + 0.2], [x + 0.3, -x, far])
        };
        (0..n).map(ray).collect()
    }

    /// A `.npy` file, version 1, from a header and data.
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
        read_rays(&path).map_err(text)
    }

    fn refused(bytes: &[u8], because: &[&str]) {
        let text = read(bytes).unwrap_err();
        for part in because {
            assert!(text.contains(part), "'{text}' lacks '{part}'");
        }
    }

    #[test]
    fn rays_read_back_as_written() {
        let dir = TempDir::new().unwrap();
        let path = dir.path().join("rays.npy");
        for mut rays in [rays(0), rays(5), rays(1)] {
            write_rays(&path, rays.len(), rays.iter().copied()).unwrap();
            assert_eq!(read_rays(&path).unwrap(), rays);
            for ray in &mut rays {
                (ray.t_min, ray.t_max) = (0.25, 4.0);
            }
            write_rays(&path, rays.len(), rays.iter().copied()).unwrap();
            assert_eq!(read_rays(&path).unwrap(), rays);
        }
    }

    #[test]
    fn byte_order_and_axis_order_do_not_matter() {
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
    fn another_type_or_shape_is_named() {
        let data = [0; 64];
        for (descr, says) in [("<f8", "'<f8'; convert"), ("<i4", "'<i4'"), ("|O", "found")] {
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
    fn a_truncated_file_is_refused_wherever_it_ends() {
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
