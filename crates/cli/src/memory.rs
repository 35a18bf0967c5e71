//! How much memory this process and its device hold.

use crate::stop::Stop;
use backend::DeviceBytes;
use serde::Serialize;

/// Memory of a device by what it holds, where that was most.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct DeviceMemory {
    bytes: Parts<u64>,
    bytes_per_triangle: Parts<f64>,
}

/// The same as [`DeviceBytes`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Parts<T> {
    tree: T,
    scratch: T,
    scene: T,
    frames: T,
}

impl DeviceMemory {
    /// Of a scene of so many triangles.
    pub(crate) fn of(bytes: DeviceBytes, triangles: usize) -> Self {
        let DeviceBytes {
            tree,
            scratch,
            scene,
            frames,
        } = bytes;
        let each = |bytes: u64| bytes as f64 / triangles.max(1) as f64;
        Self {
            bytes: Parts {
                tree,
                scratch,
                scene,
                frames,
            },
            bytes_per_triangle: Parts {
                tree: each(tree),
                scratch: each(scratch),
                scene: each(scene),
                frames: each(frames),
            },
        }
    }
}

impl DeviceMemory {
    /// Bytes in all.
    pub(crate) fn total(self) -> u64 {
        let Parts {
            tree,
            scratch,
            scene,
            frames,
        } = self.bytes;
        tree + scratch + scene + frames
    }
}

/// The larger of two, as far as they are known.
pub(crate) fn larger(a: Option<DeviceBytes>, b: Option<DeviceBytes>) -> Option<DeviceBytes> {
    a.into_iter().chain(b).max_by_key(|bytes| bytes.total())
}

/// Bytes a triangle that the host holds at least while trees are built and traced, its key frames aside.
const TREE_BYTES: u64 = 192;

/// Refuses scenes whose trees the host's memory does not hold.
pub(crate) fn check_trees(triangles: usize) -> Result<(), Stop> {
    let checked = host::check(triangles as u64 * TREE_BYTES);
    checked.map_err(|e| Stop::bad(format!("trees over {triangles} triangles: {e}")))
}

/// Bytes that are resident, where the system tells.
#[cfg(target_os = "linux")]
pub(crate) fn resident_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: u64 = text.split(' ').nth(1)?.parse().ok()?;
    Some(pages * rustix::param::page_size() as u64)
}

/// Bytes that are resident, where the system tells.
#[cfg(not(target_os = "linux"))]
pub(crate) fn resident_bytes() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_that_memory_does_not_hold_are_bad_input() {
        check_trees(1_000_000).unwrap();
        let stop = check_trees(usize::MAX / 1000).unwrap_err();
        assert!(matches!(stop, Stop::Bad(_)));
        assert!(stop.text().contains("are needed"), "{stop}");
    }

    #[test]
    fn parts_are_told_whole_and_a_triangle() {
        let bytes = DeviceBytes {
            tree: 100,
            scratch: 8,
            scene: 30,
            frames: 6,
        };
        let json = serde_json::to_value(DeviceMemory::of(bytes, 4)).unwrap();
        assert_eq!(json["bytes"]["scene"], 30);
        assert_eq!(json["bytes_per_triangle"]["scratch"], 2.0);
        assert_eq!(json["bytes_per_triangle"]["tree"], 25.0);
        assert_eq!(json["bytes_per_triangle"]["frames"], 1.5);
        let less = DeviceBytes { tree: 99, ..bytes };
        assert_eq!(larger(Some(bytes), Some(less)), Some(bytes));
        assert_eq!(larger(None, Some(less)), Some(less));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_in_use_is_counted() {
        let before = resident_bytes().unwrap();
        let block = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = resident_bytes().unwrap();
        assert!(after >= before + (48 << 20), "{before} {after}");
        drop(block);
    }
}
