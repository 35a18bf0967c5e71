//! How cores are shared between rendering and building, and how much memory a run is going to take.

use backend::Policy;
use backend::{DeviceKind, Intersector, Method};
use geom::{Animation, Point};
use serde::Serialize;

/// Bytes a triangle of what the host holds at most while trees are built and traced: corners, colours, boxes, the tree
/// in use, the one that is built and what it is built from. Measured: 215 to 345.
pub const TREE_BYTES: u64 = 345;
/// Bytes a ray, of hits, shadows and pixels in three frames.
const RAY_BYTES: u64 = 64;
const BASE_BYTES: u64 = 16 << 20;
/// Bytes a triangle of a tree on a device: its record, nodes, lists, and as many trees as may be under way.
/// Measured: 122 to 141, docs/measured.md.
const DEVICE_TREE_BYTES: u64 = 160;
/// The same where the device makes the tree, with room to make it in.
const DEVICE_REBUILD_BYTES: u64 = 260;
/// Bytes a triangle of the tree that is evaluated next to the current one: its nodes, lists and triangle data.
const CANDIDATE_BYTES: u64 = 130;
/// Bytes of a device's buffers that depend on nothing.
const DEVICE_BASE_BYTES: u64 = 1 << 20;
/// Bytes of the places where few rays are settled.
const EXACT_BASE_BYTES: u64 = 4 * (3 << 16) + 4 * 64 * 2048;
/// Frames whose rays a device holds at a time.
const TRACES: u64 = backend::FRAMES_IN_FLIGHT as u64 + 1;

/// What a run is expected to take at most, by what is known before trees are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ExpectedMemory {
    /// Bytes of the host, a driver's own aside.
    pub host_bytes: u64,
    /// Bytes of the device's buffers, if it is not the host.
    pub device_bytes: Option<u64>,
}

impl ExpectedMemory {
    /// Of a run on a device that traces so many rays in each frame.
    #[must_use]
    pub fn of(
        animation: &Animation,
        device: DeviceKind,
        (method, update): (Method, Policy),
        rays: usize,
    ) -> Self {
        let keys = keys_bytes(animation);
        let trees = trees_bytes(animation.triangle_count(), rays);
        let candidate = candidate_bytes(animation, update);
        let on_host = match device {
            DeviceKind::Cpu => candidate,
            DeviceKind::Gpu | DeviceKind::Software => 0,
        };
        let on_device = || device_bytes(animation, (method, update), rays) + candidate;
        Self {
            host_bytes: BASE_BYTES + keys + trees + on_host,
            device_bytes: (device != DeviceKind::Cpu).then(on_device),
        }
    }
}

/// Only a builder that runs free makes trees that are evaluated.
fn candidate_bytes(animation: &Animation, update: Policy) -> u64 {
    if update.adopts_by_cost() {
        animation.live_count() as u64 * CANDIDATE_BYTES
    } else {
        0
    }
}

fn keys_bytes(animation: &Animation) -> u64 {
    let kept = animation.window().unwrap_or(animation.key_count());
    (kept * animation.vertex_count() * size_of::<Point>()) as u64
}

/// Bytes that the host takes for trees over so many triangles and for the answers to so many rays.
#[must_use]
pub fn trees_bytes(triangles: usize, rays: usize) -> u64 {
    let trees = (triangles as u64).saturating_mul(TREE_BYTES);
    trees.saturating_add((rays as u64).saturating_mul(RAY_BYTES))
}

fn device_bytes(animation: &Animation, (method, update): (Method, Policy), rays: usize) -> u64 {
    const POINT: u64 = size_of::<Point>() as u64;
    let vertices = animation.vertex_count() as u64;
    let triangles = animation.triangle_count() as u64;
    // Two frames' positions, and which rows of them move.
    let scene = keys_bytes(animation) + vertices * (2 * POINT + 4) + triangles * 12;
    let tree = if update.builds_on_device() {
        DEVICE_REBUILD_BYTES
    } else {
        DEVICE_TREE_BYTES
    };
    // A hit, a shadow and, for exact, places for what is settled later.
    let answers = match method.intersector {
        Intersector::Exact => rays as u64 * 40 + EXACT_BASE_BYTES,
        _ => rays as u64 * 20,
    };
    DEVICE_BASE_BYTES + scene + animation.live_count() as u64 * tree + TRACES * answers
}

/// Threads of the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads {
    /// For the backend and for shading.
    pub render: usize,
    /// For trees.
    pub build: usize,
}

impl Threads {
    /// Shares `cores` out, where threads that render or build are not given. With `async` both work at once: where the host
    /// renders, a quarter builds on four cores or more; where a GPU does, all but the one that feeds it. With the other
    /// policies one waits for the other, so both have all.
    #[must_use]
    pub fn share(
        cores: usize,
        kind: DeviceKind,
        update: Policy,
        [render, build]: [Option<usize>; 2],
    ) -> Self {
        let quarter = |n: usize| (n / 4).max(1);
        let concurrent = update.builds_beside_frames();
        let n = render.unwrap_or(cores);
        let (render, default) = match (concurrent, kind, render) {
            (false, ..) => (n, n),
            (true, DeviceKind::Gpu, _) => (n, (n - 1).max(1)),
            (true, _, None) if cores >= 4 => (cores - quarter(cores), quarter(cores)),
            (true, _, None) => (n, 1),
            (true, _, Some(n)) => (n, quarter(n)),
        };
        Self {
            render,
            build: build.unwrap_or(default),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cores_are_shared_where_builder_and_renderer_work_at_once() {
        use DeviceKind::{Cpu, Gpu, Software};
        let (free, refit) = (Policy::Async, Policy::Refit);
        // Cores, what was asked for, and threads that render and that build.
        for (kind, update, cores, asked, expected) in [
            (Cpu, free, 16, [None, None], [12, 4]),
            (Software, free, 16, [None, None], [12, 4]),
            (Cpu, free, 4, [None, None], [3, 1]),
            (Cpu, free, 2, [None, None], [2, 1]),
            (Cpu, free, 16, [Some(1), None], [1, 1]),
            (Software, free, 16, [Some(8), None], [8, 2]),
            (Gpu, free, 16, [None, None], [16, 15]),
            (Gpu, free, 1, [None, None], [1, 1]),
            (Gpu, free, 16, [Some(1), None], [1, 1]),
            (Gpu, free, 16, [None, Some(3)], [16, 3]),
            // Who waits lends all.
            (Cpu, refit, 8, [None, None], [8, 8]),
            (Gpu, refit, 8, [Some(2), Some(5)], [2, 5]),
        ] {
            let t = Threads::share(cores, kind, update, asked);
            assert_eq!([t.render, t.build], expected, "{kind:?} {cores} {asked:?}");
        }
    }
}
