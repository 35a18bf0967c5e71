//! Description of devices and adapters, and the choice of an adapter.

use crate::{BackendError, Intersector, Query, Result, TreeFormat};
use serde::{Deserialize, Serialize};
use std::fmt;

crate::named! {
    /// Kind of processor that runs the backend.
    pub enum DeviceKind {
        /// A graphics processor.
        Gpu = "gpu",
        /// The host's cores, running this program's own code.
        Cpu = "cpu",
        /// A driver that runs graphics code on the host's cores.
        Software = "software",
    }
}

/// How the device rounds divisions and sums of products for which the shader does not enforce IEEE 754 rounding. This
/// affects costs of trees. It affects hits only with intersectors whose hits differ between backends (see
/// [`Intersector::is_equal_across_backends`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Arithmetic {
    /// Whether division is correctly rounded.
    pub rounds_division: bool,
    /// Whether some multiplications and additions are fused (FMA), so that the product is not rounded.
    pub fuses: bool,
}

impl Arithmetic {
    /// IEEE 754 arithmetic, as on the host: every operation is rounded once.
    pub const IEEE: Self = Self {
        rounds_division: true,
        fuses: false,
    };
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.rounds_division, self.fuses) {
            (true, false) => "every operation rounded once",
            (true, true) => "quotients rounded once, products fused",
            (false, false) => "quotients approximate, products rounded once",
            (false, true) => "quotients approximate, products fused",
        })
    }
}

/// The device that runs a backend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// The backend's name on the command line, such as `cpu`.
    pub backend: &'static str,
    /// The device's own name.
    pub adapter: String,
    /// Driver and version; empty without a driver.
    pub driver: String,
    /// Kind of processor.
    pub kind: DeviceKind,
    /// Number of threads on which this program computes; 0 if a graphics driver runs the kernels.
    pub threads: usize,
    /// How the device rounds operations for which the shader does not enforce IEEE 754 rounding.
    pub arithmetic: Arithmetic,
    /// Optional operations that the backend supports.
    pub capabilities: Capabilities,
}

/// Optional operations that a backend supports on its device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// Tree format that [`Backend::adopt`](crate::Backend::adopt) reads. Builders produce it in advance. `adopt` also
    /// accepts a tree without this format, but then converts the tree itself and takes longer.
    pub tree_format: TreeFormat,
    /// Whether one submission can trace several queries.
    pub batches: bool,
    /// Whether [`Backend::rebuild`](crate::Backend::rebuild) can build trees, or the reason why not:
    /// [`BackendError::Unsupported`], or [`BackendError::Limit`] if a limit of the device is too low.
    pub device_rebuild: Result<()>,
}

impl Capabilities {
    /// Returns the capabilities of a backend that has no optional operations.
    pub fn minimal(backend: &'static str, tree_format: TreeFormat) -> Self {
        Self {
            tree_format,
            batches: false,
            device_rebuild: Err(BackendError::no_device_trees(backend)),
        }
    }

    /// Returns whether one submission can trace these queries. Batches contain no shadow rays. `exact` does not support
    /// batches, because queries in a batch may share counters of the rays that error bounds could not decide.
    pub fn can_batch(&self, intersector: Intersector, queries: &[Query<'_>]) -> bool {
        let has_shadows = |query: &Query<'_>| query.kind.light().is_some();
        let is_simple = !intersector.is_exact() && !queries.iter().any(has_shadows);
        queries.len() < 2 || (self.batches && is_simple)
    }
}

/// Device memory of a backend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryUse {
    /// Bytes that the backend holds, or `None` if unknown. With `vulkan`, includes buffers of other scenes on a shared
    /// device.
    pub held: Option<DeviceBytes>,
    /// Bytes that were available when the device was opened, or `None` if unknown. `vulkan` gives a heap's size if the
    /// driver does not report the use of memory.
    pub available: Option<u64>,
}

/// Bytes of device memory by purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// Trees, triangle records, and the buffer of the pixels that triangles and boxes may cover (for packets and
    /// rasterization). Includes a tree that is being uploaded, a second tree after the first evaluation, and unused
    /// buffers of earlier trees.
    pub tree: u64,
    /// Scratch memory of tree builds. With `vulkan`, also staging buffers that are free or that unfinished uploads use.
    pub scratch: u64,
    /// The scene: key frames, positions, vertex indices, list of moving vertices, coordinate range and colour tables.
    pub scene: u64,
    /// Inputs and outputs of frames: rays, hits, shadows, pixels, visibility buffer, counts, timestamps and parameters.
    /// With `vulkan`, also all other buffers.
    pub frames: u64,
}

impl DeviceBytes {
    /// Returns the sum.
    pub fn total(self) -> u64 {
        self.tree + self.scratch + self.scene + self.frames
    }
}

/// An adapter that a backend offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Index in the backend's list.
    pub index: usize,
    /// The device's own name.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// Kind of processor.
    pub kind: DeviceKind,
    /// Limits and properties that affect performance: names and values, for display.
    pub limits: Vec<(&'static str, String)>,
}

impl AdapterInfo {
    /// Returns the adapter with index `wanted`. Without an index, returns the first GPU, or the first adapter if there
    /// is no GPU.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`], with the names of all adapters, if there is no such adapter.
    pub fn choose(list: &[Self], wanted: Option<usize>) -> Result<&Self> {
        let usual = || list.iter().find(|a| a.kind == DeviceKind::Gpu);
        let found = match wanted {
            Some(index) => list.iter().find(|a| a.index == index),
            None => usual().or(list.first()),
        };
        let reason = || match wanted {
            Some(index) if !list.is_empty() => {
                format!("no adapter {index} among {}", Self::numbered(list))
            }
            _ => "no adapter was found".to_owned(),
        };
        found.ok_or_else(|| BackendError::NoDevice(reason()))
    }

    /// Returns the indices and names, for display.
    pub fn numbered<'a>(list: impl IntoIterator<Item = &'a Self>) -> String {
        let each = list.into_iter().map(|a| format!("{}: {}", a.index, a.name));
        each.collect::<Vec<_>>().join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::QueryKind;

    #[test]
    fn batches_have_no_shadows_and_are_not_exact() {
        let mut capabilities = Capabilities::minimal("cpu", TreeFormat::Binary);
        let light = [0.0; 3];
        let query = |kind| Query {
            rays: crate::Rays::OnDevice(1),
            kind,
        };
        let [closest, shadow] =
            [QueryKind::Closest, QueryKind::ClosestAndShadow { light }].map(query);
        let mut can = |batches, intersector, queries: &[_]| {
            capabilities.batches = batches;
            capabilities.can_batch(intersector, queries)
        };
        let watertight = Intersector::Watertight;
        assert!(can(false, Intersector::Exact, &[shadow]));
        assert!(can(true, watertight, &[closest; 2]));
        assert!(!can(false, watertight, &[closest; 2]));
        assert!(!can(true, watertight, &[closest, shadow]));
        assert!(!can(true, Intersector::Exact, &[closest; 2]));
    }

    #[test]
    fn chooses_adapter_by_index_or_kind() {
        let adapter = |index, name: &str, kind| AdapterInfo {
            index,
            name: name.to_owned(),
            driver: String::new(),
            kind,
            limits: Vec::new(),
        };
        let list = [
            adapter(0, "llvmpipe", DeviceKind::Software),
            adapter(1, "card", DeviceKind::Gpu),
        ];
        assert_eq!(AdapterInfo::choose(&list, None), Ok(&list[1]));
        assert_eq!(AdapterInfo::choose(&list[..1], None), Ok(&list[0]));
        assert_eq!(AdapterInfo::choose(&list, Some(0)), Ok(&list[0]));
        // Indices refer to the full list, not to this part.
        assert_eq!(AdapterInfo::choose(&list[1..], Some(1)), Ok(&list[1]));
        let refused = AdapterInfo::choose(&list, Some(9)).unwrap_err().to_string();
        assert!(refused.ends_with("0: llvmpipe; 1: card"), "{refused}");
        for wanted in [None, Some(0)] {
            let refused = AdapterInfo::choose(&[], wanted).unwrap_err().to_string();
            assert_eq!(refused, "no device: no adapter was found");
        }
    }
}
