//! Numbers out of accessors: checked first, then read by the `gltf` crate.
//!
//! The crate's iterators overflow, panic or stop early where an accessor leaves its buffer.
//! So every range is checked before one of them is made.

use super::document::File;
use crate::SceneError;
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, Item, Iter, sparse};
use gltf::buffer::View;

/// An element of several components.
#[derive(Clone)]
struct Element<T, const N: usize>([T; N]);

impl<T: Item, const N: usize> Item for Element<T, N> {
    fn from_slice(bytes: &[u8]) -> Self {
        Self(std::array::from_fn(|i| {
            T::from_slice(&bytes[i * size_of::<T>()..])
        }))
    }

    fn zero() -> Self {
        Self(std::array::from_fn(|_| T::zero()))
    }
}

/// Reads an accessor of N floats an element; integers are normalised if the accessor says so.
pub(super) fn floats<const N: usize>(
    file: &File,
    accessor: &Accessor<'_>,
) -> Result<Vec<[f32; N]>, SceneError> {
    let dimensions = match N {
        1 => Dimensions::Scalar,
        3 => Dimensions::Vec3,
        4 => Dimensions::Vec4,
        _ => Dimensions::Mat4,
    };
    expect(file, accessor, dimensions)?;
    let kind = accessor.data_type();
    if dimensions == Dimensions::Mat4 && kind != DataType::F32 {
        return Err(unexpected(file, accessor, "32-bit floats"));
    }
    match kind {
        DataType::F32 => converted::<f32, N>(file, accessor, 1.0),
        DataType::I8 => converted::<i8, N>(file, accessor, 127.0),
        DataType::U8 => converted::<u8, N>(file, accessor, 255.0),
        DataType::I16 => converted::<i16, N>(file, accessor, 32767.0),
        DataType::U16 => converted::<u16, N>(file, accessor, 65535.0),
        DataType::U32 => {
            let what = "numbers that are not 32-bit integers";
            Err(unexpected(file, accessor, what))
        }
    }
}

/// Reads components of one type; `largest` stands for 1 if they are normalised.
fn converted<T: Item + Copy + Into<f32>, const N: usize>(
    file: &File,
    accessor: &Accessor<'_>,
    largest: f32,
) -> Result<Vec<[f32; N]>, SceneError> {
    let normalised = accessor.normalized() && largest > 1.0;
    let convert = |x: T| match normalised {
        // Of a signed integer both lowest values mean -1.
        true => (x.into() / largest).max(-1.0),
        false => x.into(),
    };
    let read = items::<Element<T, N>>(file, accessor)?;
    Ok(read.into_iter().map(|e| e.0.map(convert)).collect())
}

/// Reads a scalar accessor of unsigned integers.
pub(super) fn indices(file: &File, accessor: &Accessor<'_>) -> Result<Vec<u32>, SceneError> {
    fn wide<T: Item + Clone + Into<u32>>(
        file: &File,
        accessor: &Accessor<'_>,
    ) -> Result<Vec<u32>, SceneError> {
        let read = items::<T>(file, accessor)?;
        Ok(read.into_iter().map(Into::into).collect())
    }
    expect(file, accessor, Dimensions::Scalar)?;
    match accessor.data_type() {
        DataType::U8 => wide::<u8>(file, accessor),
        DataType::U16 => wide::<u16>(file, accessor),
        DataType::U32 => wide::<u32>(file, accessor),
        _ => Err(unexpected(file, accessor, "unsigned integers")),
    }
}

fn unexpected(file: &File, accessor: &Accessor<'_>, what: &str) -> SceneError {
    let (kind, dimensions) = (accessor.data_type(), accessor.dimensions());
    let cause = format!("{what} are expected, {kind:?} {dimensions:?} are declared");
    file.wrong(("accessor", accessor.index()), cause)
}

fn expect(file: &File, accessor: &Accessor<'_>, dimensions: Dimensions) -> Result<(), SceneError> {
    if accessor.dimensions() == dimensions {
        return Ok(());
    }
    let what = format!("{dimensions:?} elements");
    Err(unexpected(file, accessor, &what))
}

/// How many elements there are, once they are known to be there.
pub(super) fn count(file: &File, accessor: &Accessor<'_>) -> Result<usize, SceneError> {
    if accessor.count() > 0 {
        check_ranges(file, accessor)
            .map_err(|cause| file.wrong(("accessor", accessor.index()), cause))?;
    }
    Ok(accessor.count())
}

fn items<T: Item + Clone>(file: &File, accessor: &Accessor<'_>) -> Result<Vec<T>, SceneError> {
    let count = count(file, accessor)?;
    if count == 0 {
        return Ok(Vec::new());
    }
    if accessor.view().is_none() && accessor.sparse().is_none() {
        let mut zeros =
            host::room(count).map_err(|e| file.wrong(("accessor", accessor.index()), e))?;
        zeros.resize(count, T::zero());
        return Ok(zeros);
    }
    let data = |buffer: gltf::Buffer<'_>| file.buffers.get(buffer.index()).map(Vec::as_slice);
    // An iterator over sparse values alone starts from zeros, `count` of them: as many as memory holds.
    let iterator = Iter::new(accessor.clone(), data);
    let read: Vec<T> = iterator.into_iter().flatten().collect();
    if read.len() != count {
        let found = read.len();
        let cause = format!("{count} elements are declared, {found} are there");
        return Err(file.wrong(("accessor", accessor.index()), cause));
    }
    Ok(read)
}

/// Checks that all that an accessor reads lies in its views, and those in their buffers.
fn check_ranges(file: &File, accessor: &Accessor<'_>) -> Result<(), String> {
    const MOST_ZEROS: usize = 1 << 26;
    let (count, size) = (accessor.count(), accessor.size());
    match accessor.view() {
        Some(view) => check_range(file, &view, accessor.offset(), [count, size])?,
        None if count > MOST_ZEROS => {
            return Err(format!(
                "{count} elements are more than the limit of {MOST_ZEROS}"
            ));
        }
        None => {}
    }
    let Some(sparse) = accessor.sparse() else {
        return Ok(());
    };
    let replaced = sparse.count();
    if replaced == 0 {
        return Err("sparse, but no element is replaced".to_owned());
    }
    let (indices, values) = (sparse.indices(), sparse.values());
    let index_size = indices.index_type().size();
    let (at, view) = (indices.offset(), indices.view());
    check_range(file, &view, at, [replaced, index_size])?;
    check_range(file, &values.view(), values.offset(), [replaced, size])?;
    check_sparse_order(file, &sparse, count)
}

/// Checks that so many elements of a size lie in a view from an offset on.
fn check_range(
    file: &File,
    view: &View<'_>,
    offset: usize,
    [count, size]: [usize; 2],
) -> Result<(), String> {
    let buffer = file.buffers.get(view.buffer().index()).map_or(0, Vec::len);
    let (number, length) = (view.index(), view.length());
    let end = view.offset().checked_add(length);
    if end.is_none_or(|end| end > buffer) {
        return Err(format!(
            "buffer view {number} ends beyond its buffer of {buffer} bytes"
        ));
    }
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return Err(format!(
            "buffer view {number} has a stride of {stride} bytes for elements of {size}"
        ));
    }
    let end = (count - 1).checked_mul(stride);
    let end = end.and_then(|n| n.checked_add(offset)?.checked_add(size));
    if end.is_some_and(|end| end <= length) {
        return Ok(());
    }
    Err(format!(
        "{count} elements of {size} bytes from byte {offset} do not fit into buffer view {number} of {length} bytes"
    ))
}

/// Sparse indices must rise: the iterator passes over others in silence.
fn check_sparse_order(
    file: &File,
    sparse: &sparse::Sparse<'_>,
    count: usize,
) -> Result<(), String> {
    let indices = sparse.indices();
    let size = indices.index_type().size();
    let stride = indices.view().stride().unwrap_or(size);
    let start = indices.view().offset() + indices.offset();
    let buffer = &file.buffers[indices.view().buffer().index()];
    let mut least = 0;
    for i in 0..sparse.count() {
        let at = start + i * stride;
        let bytes = buffer[at..at + size].iter().rev();
        let index = bytes.fold(0, |n, &b| n << 8 | usize::from(b));
        if index < least || index >= count {
            return Err(format!(
                "sparse index {index} is out of order or beyond the last of {count} elements"
            ));
        }
        least = index + 1;
    }
    Ok(())
}
