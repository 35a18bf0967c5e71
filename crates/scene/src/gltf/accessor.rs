//! Reads numbers from accessors. Every range is checked before it is read.

use super::document::GltfFile;
use super::schema::{Accessor, Sparse, WholeNumber};
use crate::{Result, SceneError};

/// Type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: WholeNumber) -> Result<Self, String> {
        match code.0 {
            5120 => Ok(Self::I8),
            5121 => Ok(Self::U8),
            5122 => Ok(Self::I16),
            5123 => Ok(Self::U16),
            5125 => Ok(Self::U32),
            5126 => Ok(Self::F32),
            code => Err(format!("component type {code} is not supported")),
        }
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Reads the component at the start of `bytes`, which must contain at least one.
    fn read(self, bytes: &[u8]) -> f64 {
        match (self, bytes) {
            (Self::I8, [b, ..]) => b.cast_signed().into(),
            (Self::U8, [b, ..]) => (*b).into(),
            (Self::I16, [a, b, ..]) => i16::from_le_bytes([*a, *b]).into(),
            (Self::U16, [a, b, ..]) => u16::from_le_bytes([*a, *b]).into(),
            (Self::U32, [a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]).into(),
            (Self::F32, [a, b, c, d, ..]) => f32::from_le_bytes([*a, *b, *c, *d]).into(),
            _ => unreachable!("elements are cut to size"),
        }
    }
}

/// Accessor whose types are known to be supported.
struct Elements<'a> {
    file: &'a GltfFile,
    index: WholeNumber,
    accessor: &'a Accessor,
    component: Component,
    /// Number of components per element.
    width: usize,
}

/// Reads an accessor of N floats per element. Normalized integers become fractions.
pub(super) fn floats<const N: usize>(file: &GltfFile, index: WholeNumber) -> Result<Vec<[f32; N]>> {
    let elements = Elements::of(file, index)?;
    elements.expect(match N {
        1 => "SCALAR",
        3 => "VEC3",
        4 => "VEC4",
        _ => "MAT4",
    })?;
    let kind = elements.component;
    let largest: Option<f32> = match kind {
        Component::F32 => None,
        _ if N > 4 => return Err(elements.unexpected("32-bit floats")),
        Component::I8 => Some(127.0),
        Component::U8 => Some(255.0),
        Component::I16 => Some(32767.0),
        Component::U16 => Some(65535.0),
        Component::U32 => return Err(elements.unexpected("numbers that are not 32-bit integers")),
    };
    let largest = largest.filter(|_| elements.accessor.normalized);
    elements.read(|bytes| {
        std::array::from_fn(|i| {
            let x = kind.read(&bytes[i * kind.size()..]) as f32;
            // The two lowest values of a signed integer both mean -1.
            largest.map_or(x, |largest| (x / largest).max(-1.0))
        })
    })
}

pub(super) fn indices(file: &GltfFile, index: WholeNumber) -> Result<Vec<u32>> {
    let elements = Elements::of(file, index)?;
    elements.expect("SCALAR")?;
    match elements.component {
        kind @ (Component::U8 | Component::U16 | Component::U32) => {
            elements.read(|bytes| kind.read(bytes) as u32)
        }
        _ => Err(elements.unexpected("unsigned integers")),
    }
}

/// Iterator over elements as byte slices. Each slice extends to the next element, so it may be longer than the element.
type Rows<'a> = std::iter::Take<std::slice::Chunks<'a, u8>>;

impl<'a> Elements<'a> {
    fn of(file: &'a GltfFile, index: WholeNumber) -> Result<Self> {
        let accessor = file.accessor(index)?;
        let wrong = |cause| file.wrong(("accessor", index.0), cause);
        let component = Component::of(accessor.component_type).map_err(wrong)?;
        let width = match accessor.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            kind => return Err(wrong(format!("type {kind:?} is not supported"))),
        };
        Ok(Self {
            file,
            index,
            accessor,
            component,
            width,
        })
    }

    fn wrong(&self, cause: impl std::fmt::Display) -> SceneError {
        self.file.wrong(("accessor", self.index.0), cause)
    }

    fn unexpected(&self, what: &str) -> SceneError {
        let (kind, component) = (&self.accessor.kind, self.component);
        self.wrong(format!(
            "{what} are expected, {component:?} {kind} are declared"
        ))
    }

    fn expect(&self, kind: &str) -> Result<()> {
        if self.accessor.kind == kind {
            return Ok(());
        }
        Err(self.unexpected(&format!("{kind} elements")))
    }

    /// Returns the size of an element in bytes.
    fn size(&self) -> usize {
        self.width * self.component.size()
    }

    /// Returns the rows of the elements in the buffer view. `None` if the accessor has no buffer view, so that all
    /// elements are zero unless replaced.
    fn stored_rows(&self) -> Result<Option<Rows<'a>>, String> {
        /// Maximum number of elements without a buffer view. Their number is not bounded by the size of the file.
        const MOST_ZEROS: usize = 1 << 26;
        let count = self.accessor.count.0;
        let Some(view) = self.accessor.buffer_view else {
            if count > MOST_ZEROS {
                return Err(format!(
                    "{count} elements are more than the limit of {MOST_ZEROS}"
                ));
            }
            return Ok(None);
        };
        let rows = self.rows(view, self.accessor.byte_offset, count, self.size())?;
        Ok(Some(rows))
    }

    /// Returns the rows of `count` elements of `size` bytes each in a buffer view. `count` is at least 1.
    fn rows(
        &self,
        view: WholeNumber,
        offset: Option<WholeNumber>,
        count: usize,
        size: usize,
    ) -> Result<Rows<'a>, String> {
        let (number, offset) = (view.0, offset.map_or(0, |o| o.0));
        let (view, bytes) = self.file.view_bytes(view)?;
        let length = bytes.len();
        let stride = view.byte_stride.map_or(size, |s| s.0);
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

    /// Returns the index and the bytes of each element that `sparse` replaces.
    fn sparse_elements(&self, sparse: &Sparse) -> Result<Vec<(usize, &'a [u8])>, String> {
        let (length, count) = (sparse.count.0, self.accessor.count.0);
        if length == 0 {
            return Err("sparse, but no element is replaced".to_owned());
        }
        let kind = Component::of(sparse.indices.component_type)?;
        if !matches!(kind, Component::U8 | Component::U16 | Component::U32) {
            return Err(format!(
                "sparse indices are {kind:?}, but must be U8, U16 or U32"
            ));
        }
        let at = &sparse.indices;
        let indices = self.rows(at.buffer_view, at.byte_offset, length, kind.size())?;
        let at = &sparse.values;
        let values = self.rows(at.buffer_view, at.byte_offset, length, self.size())?;
        let mut least = 0;
        let replaced = indices.zip(values).map(|(index, value)| {
            let index = kind.read(index) as usize;
            if index < least || index >= count {
                return Err(format!(
                    "sparse index {index} is out of order or beyond the last of {count} elements"
                ));
            }
            least = index + 1;
            Ok((index, value))
        });
        replaced.collect()
    }

    fn read<T: Clone>(&self, read: impl Fn(&[u8]) -> T) -> Result<Vec<T>> {
        let mut elements = Vec::new();
        let count = self.accessor.count.0;
        if count == 0 {
            return Ok(elements);
        }
        let stored = self.stored_rows().map_err(|e| self.wrong(e))?;
        let sparse = self.accessor.sparse.as_ref();
        let replaced = sparse
            .map(|sparse| self.sparse_elements(sparse))
            .transpose();
        let replaced = replaced.map_err(|e| self.wrong(e))?;
        host::reserve(&mut elements, count).map_err(|e| self.wrong(e))?;
        match stored {
            Some(rows) => elements.extend(rows.map(&read)),
            None => elements.resize(count, read(&vec![0; self.size()])),
        }
        for (index, value) in replaced.into_iter().flatten() {
            elements[index] = read(value);
        }
        Ok(elements)
    }
}
