//! How much memory this process and its device hold.

use crate::stop::Stop;
use backend::{Backend, DeviceBytes, DeviceKind, Intersector, Method};
use geom::{Animation, Point};
use host::Free;
use pipeline::Update;
use serde::Serialize;
use std::collections::BTreeMap;

/// Memory of a device by what it holds, where that was most.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct DeviceMemory {
    bytes: BTreeMap<&'static str, u64>,
    bytes_per_triangle: BTreeMap<&'static str, f64>,
    #[serde(skip)]
    pub(crate) total: u64,
}

impl DeviceMemory {
    pub(crate) fn of(held: DeviceBytes, triangles: usize) -> Self {
        let bytes = BTreeMap::from([
            ("tree", held.tree),
            ("scratch", held.scratch),
            ("scene", held.scene),
            ("frames", held.frames),
        ]);
        let each =
            |(&name, &bytes): (&&'static str, &u64)| (name, bytes as f64 / triangles.max(1) as f64);
        Self {
            bytes_per_triangle: bytes.iter().map(each).collect(),
            bytes,
            total: held.total(),
        }
    }
}

/// Bytes a triangle of what the host holds at most while trees are built and traced: corners, colours, boxes, the tree
/// in use, the one that is built and what it is built from. Measured: 215 to 345.
const TREE_BYTES: u64 = 345;
/// Bytes a ray, of hits, shadows and pixels in three frames.
const RAY_BYTES: u64 = 64;
const BASE_BYTES: u64 = 16 << 20;
/// Bytes a triangle of a tree on a device: its record, nodes, lists, and as many trees as may be under way.
/// Measured: 122 to 141, docs/measured.md.
const DEVICE_TREE_BYTES: u64 = 160;
/// The same where the device makes the tree, with room to make it in.
const DEVICE_REBUILD_BYTES: u64 = 260;
/// Bytes of a device's buffers that depend on nothing.
const DEVICE_BASE_BYTES: u64 = 1 << 20;
/// Bytes of the places where few rays are settled.
const EXACT_BASE_BYTES: u64 = 4 * (3 << 16) + 4 * 64 * 2048;
/// Frames whose rays a device holds at a time.
const TRACES: u64 = backend::FRAMES_IN_FLIGHT as u64 + 1;

/// What a run is expected to take at most, by what is known before trees are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ExpectedMemory {
    /// Bytes of the host, a driver's own aside.
    host_bytes: u64,
    /// Bytes of the device's buffers, if it is not the host.
    device_bytes: Option<u64>,
}

impl ExpectedMemory {
    /// Of a run on a device that traces so many rays in each frame.
    pub(crate) fn of(
        animation: &Animation,
        device: DeviceKind,
        (method, update): (Method, Update),
        rays: usize,
    ) -> Self {
        let keys = keys_bytes(animation);
        let trees = trees_bytes(animation.triangle_count(), rays);
        let on_device = || device_bytes(animation, (method, update), rays);
        Self {
            host_bytes: BASE_BYTES + keys + trees,
            device_bytes: (device != DeviceKind::Cpu).then(on_device),
        }
    }
}

fn keys_bytes(animation: &Animation) -> u64 {
    let kept = animation.window().unwrap_or(animation.key_count());
    (kept * animation.vertex_count() * size_of::<Point>()) as u64
}

fn trees_bytes(triangles: usize, rays: usize) -> u64 {
    let trees = (triangles as u64).saturating_mul(TREE_BYTES);
    trees.saturating_add((rays as u64).saturating_mul(RAY_BYTES))
}

fn device_bytes(animation: &Animation, (method, update): (Method, Update), rays: usize) -> u64 {
    const POINT: u64 = size_of::<Point>() as u64;
    let vertices = animation.vertex_count() as u64;
    let triangles = animation.triangle_count() as u64;
    // Two frames' positions, and which rows of them move.
    let scene = keys_bytes(animation) + vertices * (2 * POINT + 4) + triangles * 12;
    let tree = match update {
        Update::DeviceRebuild => DEVICE_REBUILD_BYTES,
        _ => DEVICE_TREE_BYTES,
    };
    // A hit, a shadow and, for exact, places for what is settled later.
    let answers = match method.intersector {
        Intersector::Exact => rays as u64 * 40 + EXACT_BASE_BYTES,
        _ => rays as u64 * 20,
    };
    DEVICE_BASE_BYTES + scene + animation.live_count() as u64 * tree + TRACES * answers
}

/// To open a scene with, over which trees are built and so many rays are traced at a time: what that takes is asked for
/// with the key frames, before any of them is there.
pub(crate) fn with_run(options: scene::Options, rays: usize) -> scene::Options {
    scene::Options {
        more_bytes: trees_bytes(0, rays),
        triangle_bytes: TREE_BYTES,
        ..options
    }
}

/// Refuses scenes whose trees and rays the host's memory does not hold. Key frames are there already.
pub(crate) fn check_trees(triangles: usize, rays: usize) -> Result<(), Stop> {
    let checked = host::check(trees_bytes(triangles, rays));
    checked.map_err(|e| Stop::bad(format!("trees over {triangles} triangles: {e}")))
}

/// Refuses scenes that do not fit the device's memory, where its driver tells; of a device that is the host's cores,
/// also what the host does not hold.
pub(crate) fn check_device(
    backend: &dyn Backend,
    animation: &Animation,
    how: (Method, Update),
    rays: usize,
) -> Result<(), Stop> {
    let kind = backend.device().kind;
    let Some(need) = ExpectedMemory::of(animation, kind, how, rays).device_bytes else {
        return Ok(());
    };
    let by = "memory of the device";
    let free = backend.free_device_bytes().map(|bytes| Free { bytes, by });
    let on_host = match kind {
        DeviceKind::Software => host::free(),
        _ => None,
    };
    let checked = host::within(need, free).and_then(|()| host::within(need, on_host));
    checked.map_err(|e| {
        let (name, triangles) = (&backend.device().adapter, animation.triangle_count());
        Stop::bad(format!("{triangles} triangles on {name}: {e}"))
    })
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
        check_trees(1_000_000, 1 << 20).unwrap();
        let stop = check_trees(usize::MAX / 1000, 0).unwrap_err();
        assert!(matches!(stop, Stop::Bad(_)));
        assert!(stop.to_string().contains("are needed"), "{stop}");
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
        let parts = |of: &str| ["tree", "scratch", "scene", "frames"].map(|p| json[of][p].as_f64());
        assert_eq!(parts("bytes"), [100.0, 8.0, 30.0, 6.0].map(Some));
        assert_eq!(parts("bytes_per_triangle"), [25.0, 2.0, 7.5, 1.5].map(Some));
    }
}
