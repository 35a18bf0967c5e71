//! Whether accessors stay within their buffers.
//!
//! The iterators of the `gltf` crate overflow, panic or stop early where they do not.

use super::document::File;
use gltf::Accessor;
use gltf::accessor::sparse;
use gltf::buffer::View;

/// Checks that all that an accessor reads lies in its views, and those in their buffers.
pub(super) fn check_ranges(file: &File, accessor: &Accessor<'_>) -> Result<(), String> {
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
