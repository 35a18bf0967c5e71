//! Numbers out of accessors, every range checked before it is read.

use super::document::File;
use crate::{Result, SceneError};
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, Item};
use gltf::buffer::View;

/// Reads an accessor of N floats an element; integers are normalised if the accessor says so.
pub(super) fn floats<const N: usize>(
    file: &File,
    accessor: &Accessor<'_>,
) -> Result<Vec<[f32; N]>> {
    let dimensions = match N {
        1 => Dimensions::Scalar,
        3 => Dimensions::Vec3,
        4 => Dimensions::Vec4,
        _ => Dimensions::Mat4,
    };
    expect(file, accessor, dimensions)?;
    let kind = accessor.data_type();
    let unexpected = |what| Err(unexpected(file, accessor, what));
    let largest: Option<f32> = match kind {
        DataType::F32 => None,
        _ if dimensions == Dimensions::Mat4 => return unexpected("32-bit floats"),
        DataType::I8 => Some(127.0),
        DataType::U8 => Some(255.0),
        DataType::I16 => Some(32767.0),
        DataType::U16 => Some(65535.0),
        DataType::U32 => return unexpected("numbers that are not 32-bit integers"),
    };
    let largest = largest.filter(|_| accessor.normalized());
    elements(file, accessor, |bytes| {
        std::array::from_fn(|i| {
            let x = number(kind, &bytes[i * kind.size()..]) as f32;
            // Of a signed integer both lowest values mean -1.
            largest.map_or(x, |largest| (x / largest).max(-1.0))
        })
    })
}

/// Likewise, of an accessor that may be left out; nothing then.
pub(super) fn listed<const N: usize>(
    file: &File,
    accessor: Option<Accessor<'_>>,
) -> Result<Vec<[f32; N]>> {
    accessor.map_or(Ok(Vec::new()), |accessor| floats(file, &accessor))
}

pub(super) fn indices(file: &File, accessor: &Accessor<'_>) -> Result<Vec<u32>> {
    expect(file, accessor, Dimensions::Scalar)?;
    match accessor.data_type() {
        kind @ (DataType::U8 | DataType::U16 | DataType::U32) => {
            elements(file, accessor, |bytes| number(kind, bytes) as u32)
        }
        _ => Err(unexpected(file, accessor, "unsigned integers")),
    }
}

/// How many elements there are, once they are known to be there.
pub(super) fn count(file: &File, accessor: &Accessor<'_>) -> Result<usize> {
    find(file, accessor).map_err(|e| wrong(file, accessor, e))?;
    Ok(accessor.count())
}

fn wrong(file: &File, accessor: &Accessor<'_>, cause: impl std::fmt::Display) -> SceneError {
    file.wrong(("accessor", accessor.index()), cause)
}

fn unexpected(file: &File, accessor: &Accessor<'_>, what: &str) -> SceneError {
    let (kind, dimensions) = (accessor.data_type(), accessor.dimensions());
    let cause = format!("{what} are expected, {kind:?} {dimensions:?} are declared");
    wrong(file, accessor, cause)
}

fn expect(file: &File, accessor: &Accessor<'_>, dimensions: Dimensions) -> Result<()> {
    if accessor.dimensions() == dimensions {
        return Ok(());
    }
    let what = format!("{dimensions:?} elements");
    Err(unexpected(file, accessor, &what))
}

fn number(kind: DataType, bytes: &[u8]) -> f64 {
    match kind {
        DataType::I8 => i8::from_slice(bytes).into(),
        DataType::U8 => u8::from_slice(bytes).into(),
        DataType::I16 => i16::from_slice(bytes).into(),
        DataType::U16 => u16::from_slice(bytes).into(),
        DataType::U32 => u32::from_slice(bytes).into(),
        DataType::F32 => f32::from_slice(bytes).into(),
    }
}

/// Elements, each with what lies between it and the next.
type Rows<'a> = std::iter::Take<std::slice::Chunks<'a, u8>>;

/// So many elements of a size in a view from an offset on, if they are there.
fn rows<'a>(
    file: &'a File,
    view: &View<'_>,
    offset: usize,
    [count, size]: [usize; 2],
) -> Result<Rows<'a>, String> {
    let buffer = file.buffers.get(view.buffer().index());
    let buffer = buffer.map_or(&[][..], Vec::as_slice);
    let (number, length) = (view.index(), view.length());
    let rest = buffer.get(view.offset()..);
    let Some(bytes) = rest.and_then(|rest| rest.get(..length)) else {
        let all = buffer.len();
        return Err(format!(
            "buffer view {number} ends beyond its buffer of {all} bytes"
        ));
    };
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return Err(format!(
            "buffer view {number} has a stride of {stride} bytes for elements of {size}"
        ));
    }
    let end = (count - 1).checked_mul(stride);
    let end = end.and_then(|n| n.checked_add(offset)?.checked_add(size));
    if end.is_none_or(|end| end > length) {
        return Err(format!(
            "{count} elements of {size} bytes from byte {offset} do not fit into buffer view {number} of {length} bytes"
        ));
    }
    Ok(bytes[offset..].chunks(stride).take(count))
}

/// An accessor's own elements, if they are not zeros; and those that replace some of them, by their places.
type Elements<'a> = (Option<Rows<'a>>, Vec<(usize, &'a [u8])>);

fn find<'a>(file: &'a File, accessor: &Accessor<'_>) -> Result<Elements<'a>, String> {
    const MOST_ZEROS: usize = 1 << 26;
    let (count, size) = (accessor.count(), accessor.size());
    if count == 0 {
        return Ok((None, Vec::new()));
    }
    let own = accessor.view();
    if own.is_none() && count > MOST_ZEROS {
        return Err(format!(
            "{count} elements are more than the limit of {MOST_ZEROS}"
        ));
    }
    let own = own.map(|view| rows(file, &view, accessor.offset(), [count, size]));
    let (own, mut replaced) = (own.transpose()?, Vec::new());
    let Some(sparse) = accessor.sparse() else {
        return Ok((own, replaced));
    };
    let (indices, values, length) = (sparse.indices(), sparse.values(), sparse.count());
    if length == 0 {
        return Err("sparse, but no element is replaced".to_owned());
    }
    let digits = indices.index_type().size();
    let (at, view) = (indices.offset(), indices.view());
    let places = rows(file, &view, at, [length, digits])?;
    let values = rows(file, &values.view(), values.offset(), [length, size])?;
    let mut least = 0;
    for (place, value) in places.zip(values) {
        let index = place[..digits].iter().rev();
        let index = index.fold(0, |n, &b| n << 8 | usize::from(b));
        if index < least || index >= count {
            return Err(format!(
                "sparse index {index} is out of order or beyond the last of {count} elements"
            ));
        }
        least = index + 1;
        replaced.push((index, value));
    }
    Ok((own, replaced))
}

fn elements<T: Clone>(
    file: &File,
    accessor: &Accessor<'_>,
    read: impl Fn(&[u8]) -> T,
) -> Result<Vec<T>> {
    let (own, replaced) = find(file, accessor).map_err(|e| wrong(file, accessor, e))?;
    let count = accessor.count();
    let mut elements = host::room(count).map_err(|e| wrong(file, accessor, e))?;
    match own {
        Some(own) => elements.extend(own.map(&read)),
        None => elements.resize(count, read(&vec![0; accessor.size()])),
    }
    for (index, value) in replaced {
        elements[index] = read(value);
    }
    Ok(elements)
}
