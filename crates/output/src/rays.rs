//! Rays as `.npy` arrays: f32 (N, 6) `ox oy oz dx dy dz`, or (N, 8) with `t_min t_max` appended.

use crate::atomic::{OutputError, WriteError, write_with};
use geom::Ray;
use npyz::{DType, NpyFile, NpyHeader, Order, TypeChar, WriteOptions, WriterBuilder};
use std::io::{self, BufReader, Read};
use std::path::Path;

/// A header of two dimensions and one type takes about a hundred bytes; longer ones are no rays.
const MAX_HEADER: u32 = 4096;

/// Reads rays of either byte order, in C or Fortran order.
///
/// Without `t_min t_max` a ray covers `(0, inf)`. Numbers that are not finite
/// are kept: such rays miss (see [`Ray::is_valid`]).
///
/// # Errors
/// It holds no rays: what was found and what is wanted.
pub fn read_rays(path: &Path) -> Result<Vec<Ray>, OutputError> {
    let name = path.display();
    let unreadable = |cause| OutputError::reading(path, cause);
    let refused = |reason| OutputError(format!("{name}: {reason}"));
    let file = host::open(path).map_err(unreadable)?;
    let mut reader = BufReader::with_capacity(1 << 18, file);
    let no_array = |reason| refused(format!("not a .npy array: {reason}"));
    let (header, header_bytes) = read_header(&mut reader).map_err(no_array)?;
    let (rays, columns) = check(&header).map_err(refused)?;
    let size = reader.get_ref().metadata().map_err(unreadable)?.len();
    let found = size.saturating_sub(header_bytes);
    let wanted = u128::from(rays) * u128::from(columns) * 4;
    if wanted > u128::from(found) {
        let shape = shape_text(header.shape());
        return Err(refused(format!(
            "truncated: shape {shape} takes {wanted} bytes of data, found {found}"
        )));
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
///
/// # Errors
/// [`WriteError`]; `path` then holds what it held before.
pub fn write_rays(
    path: &Path,
    count: usize,
    rays: impl Iterator<Item = Ray> + Clone,
) -> Result<(), WriteError> {
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

/// Digits after the key `shape`, up to the end of its tuple.
///
/// The product of numbers with `n` digits in all is below `10^n`; up to 19 it
/// fits u64, which `npyz` takes for granted.
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
            let found = shape_text(other);
            Err(format!(
                "rays must have shape (N, 6) or (N, 8), found {found}"
            ))
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
mod tests;
