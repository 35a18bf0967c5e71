//! Numbers out of accessors: checked first, then read by the `gltf` crate.
//!
//! Every range is checked before one of its iterators is made; see [`super::range`].

use super::document::File;
use super::range::check_ranges;
use super::wrong;
use crate::{FileLocation, SceneError};
use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions, Item, Iter};

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

fn place(accessor: &Accessor<'_>) -> FileLocation {
    FileLocation::Item("accessor", accessor.index())
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

/// How many elements there are, once they are known to be there.
pub(super) fn count(file: &File, accessor: &Accessor<'_>) -> Result<usize, SceneError> {
    if accessor.count() > 0 {
        check_ranges(file, accessor).map_err(|cause| wrong(file, place(accessor), cause))?;
    }
    Ok(accessor.count())
}

fn items<T: Item + Clone>(file: &File, accessor: &Accessor<'_>) -> Result<Vec<T>, SceneError> {
    if count(file, accessor)? == 0 {
        return Ok(Vec::new());
    }
    if accessor.view().is_none() && accessor.sparse().is_none() {
        let mut zeros =
            host::room(accessor.count()).map_err(|e| wrong(file, place(accessor), e))?;
        zeros.resize(accessor.count(), T::from_slice(&[0; 64]));
        return Ok(zeros);
    }
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
