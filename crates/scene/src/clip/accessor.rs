//! Numbers out of accessors: checked first, then read by the `gltf` crate.
//!
//! Its iterators overflow, panic or stop early on data that is too short, so
//! every range is checked here before one is made.

use super::document::File;
use super::wrong;
use crate::{Place, SceneError};
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, Item, Iter, sparse};
use gltf::buffer::View;

/// Reads a scalar accessor as f32; integers are normalised if the accessor says so.
pub(super) fn scalars(file: &File, accessor: &Accessor<'_>) -> Result<Vec<f32>, SceneError> {
    expect(file, accessor, Dimensions::Scalar)?;
    let normal = |scale: f32| if accessor.normalized() { scale } else { 1.0 };
    Ok(match accessor.data_type() {
        DataType::F32 => items::<f32>(file, accessor)?,
        DataType::I8 => mapped(items::<i8>(file, accessor)?, |x| {
            signed(x.into(), normal(127.0))
        }),
        DataType::U8 => mapped(items::<u8>(file, accessor)?, |x| {
            f32::from(x) / normal(255.0)
        }),
        DataType::I16 => mapped(items::<i16>(file, accessor)?, |x| {
            signed(x.into(), normal(32767.0))
        }),
        DataType::U16 => mapped(items::<u16>(file, accessor)?, |x| {
            f32::from(x) / normal(65535.0)
        }),
        DataType::U32 => {
            return Err(unexpected(
                file,
                accessor,
                "numbers that are not 32-bit integers",
            ));
        }
    })
}

/// Reads an accessor of vectors as f32; integers are normalised if the accessor says so.
pub(super) fn vectors<const N: usize>(
    file: &File,
    accessor: &Accessor<'_>,
) -> Result<Vec<[f32; N]>, SceneError>
where
    [f32; N]: Item,
    [i8; N]: Item,
    [u8; N]: Item,
    [i16; N]: Item,
    [u16; N]: Item,
{
    expect(
        file,
        accessor,
        if N == 3 {
            Dimensions::Vec3
        } else {
            Dimensions::Vec4
        },
    )?;
    let normal = |scale: f32| if accessor.normalized() { scale } else { 1.0 };
    Ok(match accessor.data_type() {
        DataType::F32 => items::<[f32; N]>(file, accessor)?,
        DataType::I8 => mapped(items::<[i8; N]>(file, accessor)?, |v| {
            v.map(|x| signed(x.into(), normal(127.0)))
        }),
        DataType::U8 => mapped(items::<[u8; N]>(file, accessor)?, |v| {
            v.map(|x| f32::from(x) / normal(255.0))
        }),
        DataType::I16 => mapped(items::<[i16; N]>(file, accessor)?, |v| {
            v.map(|x| signed(x.into(), normal(32767.0)))
        }),
        DataType::U16 => mapped(items::<[u16; N]>(file, accessor)?, |v| {
            v.map(|x| f32::from(x) / normal(65535.0))
        }),
        DataType::U32 => {
            return Err(unexpected(
                file,
                accessor,
                "numbers that are not 32-bit integers",
            ));
        }
    })
}

/// Reads an accessor of 4x4 matrices, column by column.
pub(super) fn matrices(
    file: &File,
    accessor: &Accessor<'_>,
) -> Result<Vec<[[f32; 4]; 4]>, SceneError> {
    expect(file, accessor, Dimensions::Mat4)?;
    match accessor.data_type() {
        DataType::F32 => items::<[[f32; 4]; 4]>(file, accessor),
        _ => Err(unexpected(file, accessor, "32-bit floats")),
    }
}

/// Reads a scalar accessor of unsigned integers.
pub(super) fn indices(file: &File, accessor: &Accessor<'_>) -> Result<Vec<u32>, SceneError> {
    expect(file, accessor, Dimensions::Scalar)?;
    match accessor.data_type() {
        DataType::U8 => Ok(mapped(items::<u8>(file, accessor)?, u32::from)),
        DataType::U16 => Ok(mapped(items::<u16>(file, accessor)?, u32::from)),
        DataType::U32 => items::<u32>(file, accessor),
        _ => Err(unexpected(file, accessor, "unsigned integers")),
    }
}

fn mapped<A, B>(from: Vec<A>, to: impl Fn(A) -> B) -> Vec<B> {
    from.into_iter().map(to).collect()
}

/// Of a signed normalised integer both lowest values mean -1.
fn signed(x: f32, scale: f32) -> f32 {
    if scale == 1.0 {
        x
    } else {
        (x / scale).max(-1.0)
    }
}

fn place(accessor: &Accessor<'_>) -> Place {
    Place::Item("accessor", accessor.index())
}

fn unexpected(file: &File, accessor: &Accessor<'_>, what: &str) -> SceneError {
    let found = (accessor.data_type(), accessor.dimensions());
    wrong(
        file,
        place(accessor),
        format!(
            "{what} are expected, {:?} {:?} are declared",
            found.0, found.1
        ),
    )
}

fn expect(file: &File, accessor: &Accessor<'_>, dimensions: Dimensions) -> Result<(), SceneError> {
    if accessor.dimensions() == dimensions {
        return Ok(());
    }
    Err(unexpected(
        file,
        accessor,
        &format!("{dimensions:?} elements"),
    ))
}

fn items<T: Item + Clone>(file: &File, accessor: &Accessor<'_>) -> Result<Vec<T>, SceneError> {
    if accessor.count() == 0 {
        return Ok(Vec::new());
    }
    check_ranges(file, accessor).map_err(|cause| wrong(file, place(accessor), cause))?;
    let data = |buffer: gltf::Buffer<'_>| file.buffers.get(buffer.index()).map(Vec::as_slice);
    // An iterator over sparse values alone starts from zeros, `count` of them: as many as memory holds.
    let read: Vec<T> = Iter::new(accessor.clone(), data)
        .into_iter()
        .flatten()
        .collect();
    if read.len() != accessor.count() {
        let (found, count) = (read.len(), accessor.count());
        return Err(wrong(
            file,
            place(accessor),
            format!("{count} elements are declared, {found} are there"),
        ));
    }
    Ok(read)
}

/// Checks that all that an accessor reads lies in its views, and those in their buffers.
fn check_ranges(file: &File, accessor: &Accessor<'_>) -> Result<(), String> {
    const MOST_ZEROS: usize = 1 << 26;
    match accessor.view() {
        Some(view) => check_range(
            file,
            &view,
            accessor.offset(),
            accessor.count(),
            accessor.size(),
        )?,
        None if accessor.count() > MOST_ZEROS => {
            return Err(format!(
                "{} elements are more than the limit of {MOST_ZEROS}",
                accessor.count()
            ));
        }
        None => {}
    }
    let Some(sparse) = accessor.sparse() else {
        return Ok(());
    };
    if sparse.count() == 0 {
        return Err("sparse, but no element is replaced".to_owned());
    }
    let (indices, values) = (sparse.indices(), sparse.values());
    check_range(
        file,
        &indices.view(),
        indices.offset(),
        sparse.count(),
        indices.index_type().size(),
    )?;
    check_range(
        file,
        &values.view(),
        values.offset(),
        sparse.count(),
        accessor.size(),
    )?;
    check_sparse_order(file, &sparse, accessor.count())
}

fn check_range(
    file: &File,
    view: &View<'_>,
    offset: usize,
    count: usize,
    size: usize,
) -> Result<(), String> {
    let buffer = file.buffers.get(view.buffer().index()).map_or(0, Vec::len);
    let number = view.index();
    if view
        .offset()
        .checked_add(view.length())
        .is_none_or(|end| end > buffer)
    {
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
    let end = (count - 1)
        .checked_mul(stride)
        .and_then(|n| n.checked_add(offset)?.checked_add(size));
    match end {
        Some(end) if end <= view.length() => Ok(()),
        _ => Err(format!(
            "{count} elements of {size} bytes from byte {offset} do not fit into buffer view {number} of {} bytes",
            view.length()
        )),
    }
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
        let index = buffer[at..at + size]
            .iter()
            .rev()
            .fold(0, |n, &b| n << 8 | usize::from(b));
        if index < least || index >= count {
            return Err(format!(
                "sparse index {index} is out of order or beyond the last of {count} elements"
            ));
        }
        least = index + 1;
    }
    Ok(())
}
