//! Divides cores between rendering and building, and estimates the memory of a run.

use crate::DriverOptions;
use backend::{DeviceKind, Intersector, Policy};
use geom::{Animation, Point};
use serde::Serialize;

/// Maximum bytes per triangle on the host while trees are built and traced: corners, colours, boxes, the current tree,
/// the tree being built and its input. Measured: 215 to 345.
pub const HOST_BYTES_PER_TRIANGLE: u64 = 345;
/// Bytes per ray: hits, shadows and pixels in three frames.
const RAY_BYTES: u64 = 64;
const BASE_BYTES: u64 = 16 << 20;
/// Bytes per triangle on a device for a tree: triangle records, nodes, vertex indices in leaf order, and uploaded
/// topologies. Without the buffers of a candidate tree (see [`CANDIDATE_BYTES`]). Measured: 119 with `refit`, up to 171
/// if trees are replaced.
const DEVICE_TREE_BYTES: u64 = 176;
/// Bytes per triangle on a device that builds the trees, including scratch memory.
const DEVICE_REBUILD_BYTES: u64 = 260;
/// Bytes per triangle of a candidate tree: its nodes, topology and triangle data.
const CANDIDATE_BYTES: u64 = 130;
/// Maximum number of key frames on a device if the host does not hold all: see `docs/design/key-frames.md`.
const DEVICE_KEYS: usize = 6;
/// Bytes of device buffers whose size is constant.
const DEVICE_BASE_BYTES: u64 = 1 << 20;
/// Constant part of the memory in which `exact` stores rays that rounded arithmetic cannot decide, in bytes:
/// `shaders::occluded_words` with the minimum of 2^16 candidates, two words each, and 2048 stacks of 64 words.
const EXACT_BASE_BYTES: u64 = 4 * (2 << 16) + 4 * 64 * 2048;
/// Number of traces whose results a device stores at a time.
const TRACES: u64 = backend::FRAMES_IN_FLIGHT as u64 + 1;

/// Expected maximum memory of a run, estimated before trees are built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ExpectedMemory {
    /// Bytes on the host, except for those of a graphics driver.
    pub host_bytes: u64,
    /// Bytes of device buffers; `None` if the host traces.
    pub device_bytes: Option<u64>,
}

impl ExpectedMemory {
    /// Estimates the memory of a run that traces `rays` rays per frame.
    #[must_use]
    pub fn of(
        animation: &Animation,
        device: DeviceKind,
        options: &DriverOptions,
        rays: usize,
    ) -> Self {
        let kept = animation.window().unwrap_or(animation.key_count());
        let keys = keys_bytes(animation, kept);
        let trees = trees_and_rays_bytes(animation.triangle_count(), rays);
        // With adoption by cost, a candidate tree exists in addition to the current one.
        let candidate = if options.update.adopts_by_cost() {
            animation.live_count() as u64 * CANDIDATE_BYTES
        } else {
            0
        };
        let on_host = match device {
            DeviceKind::Cpu => candidate,
            DeviceKind::Gpu | DeviceKind::Software => 0,
        };
        let on_device = || device_bytes(animation, options, rays) + candidate;
        Self {
            host_bytes: BASE_BYTES + keys + trees + on_host,
            device_bytes: (device != DeviceKind::Cpu).then(on_device),
        }
    }
}

/// Returns the bytes of `count` key frames.
fn keys_bytes(animation: &Animation, count: usize) -> u64 {
    (count * animation.vertex_count() * size_of::<Point>()) as u64
}

/// Returns the bytes on the host for trees over `triangles` triangles and for the results of `rays` rays.
#[must_use]
pub fn trees_and_rays_bytes(triangles: usize, rays: usize) -> u64 {
    let trees = (triangles as u64).saturating_mul(HOST_BYTES_PER_TRIANGLE);
    trees.saturating_add((rays as u64).saturating_mul(RAY_BYTES))
}

fn device_bytes(animation: &Animation, options: &DriverOptions, rays: usize) -> u64 {
    const POINT: u64 = size_of::<Point>() as u64;
    let vertices = animation.vertex_count() as u64;
    let triangles = animation.triangle_count() as u64;
    // `window` is `None` if the host holds all key frames.
    let kept = animation
        .window()
        .map_or(animation.key_count(), |_| DEVICE_KEYS);
    // Positions of two frames, the list of moving vertices, and the triangles' indices.
    let scene = keys_bytes(animation, kept) + vertices * (2 * POINT + 4) + triangles * 12;
    let tree = if options.update.builds_on_device() {
        DEVICE_REBUILD_BYTES
    } else {
        DEVICE_TREE_BYTES
    };
    // A hit (16 bytes) and a shadow (4). For `exact`, also a word in each of two lists of undecided rays, and a
    // candidate of two words.
    let answers = match options.intersector {
        Intersector::Exact => rays as u64 * 36 + EXACT_BASE_BYTES,
        _ => rays as u64 * 20,
    };
    DEVICE_BASE_BYTES + scene + animation.live_count() as u64 * tree + TRACES * answers
}

/// Numbers of host threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads {
    /// Threads for the backend and for shading.
    pub render: usize,
    /// Threads for builds.
    pub build: usize,
}

impl Threads {
    /// Divides `cores` between rendering and building, where the numbers are not given. With `async`, both run at once:
    /// - If a GPU renders, one thread less builds than renders.
    /// - If the host renders, a quarter of the cores builds. With fewer than four cores, one additional thread builds.
    /// - If the host renders and `render` is given, a quarter as many additional threads build.
    ///
    /// At least one thread builds.
    ///
    /// With other policies, both run alternately, so each gets all cores, or `render` threads.
    #[must_use]
    pub fn share(
        cores: usize,
        kind: DeviceKind,
        update: Policy,
        [render, build]: [Option<usize>; 2],
    ) -> Self {
        let quarter = |n: usize| (n / 4).max(1);
        let concurrent = update.builds_concurrently();
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
    use std::sync::Arc;

    #[test]
    fn devices_hold_few_paged_key_frames() {
        const VERTICES: usize = 3000;
        let options = DriverOptions {
            intersector: Intersector::Watertight,
            update: Policy::Refit,
            time_range: [0.0, 99.0],
            predict: true,
        };
        let [few, many] = [8, 50].map(|window| {
            let paged = Animation::paged(
                Arc::new(|_| Ok(vec![[0.0; 3]; VERTICES])),
                100,
                window,
                vec![[0, 1, 2]],
            );
            ExpectedMemory::of(&paged.unwrap(), DeviceKind::Gpu, &options, 0)
        });
        let key_frame = (VERTICES * size_of::<Point>()) as u64;
        assert_eq!(many.host_bytes - few.host_bytes, 42 * key_frame);
        assert_eq!(many.device_bytes, few.device_bytes);
    }

    #[test]
    fn cores_are_shared_for_concurrent_builds() {
        use DeviceKind::{Cpu, Gpu, Software};
        let (async_policy, refit) = (Policy::Async, Policy::Refit);
        // Cores, requested threads, and expected threads for rendering and for building.
        for (kind, update, cores, asked, expected) in [
            (Cpu, async_policy, 16, [None, None], [12, 4]),
            (Software, async_policy, 16, [None, None], [12, 4]),
            (Cpu, async_policy, 4, [None, None], [3, 1]),
            (Cpu, async_policy, 2, [None, None], [2, 1]),
            (Cpu, async_policy, 16, [Some(1), None], [1, 1]),
            (Software, async_policy, 16, [Some(8), None], [8, 2]),
            (Gpu, async_policy, 16, [None, None], [16, 15]),
            (Gpu, async_policy, 1, [None, None], [1, 1]),
            (Gpu, async_policy, 16, [Some(1), None], [1, 1]),
            (Gpu, async_policy, 16, [None, Some(3)], [16, 3]),
            // Rendering and building run alternately, so each gets all cores.
            (Cpu, refit, 8, [None, None], [8, 8]),
            (Gpu, refit, 8, [Some(2), Some(5)], [2, 5]),
        ] {
            let t = Threads::share(cores, kind, update, asked);
            assert_eq!([t.render, t.build], expected, "{kind:?} {cores} {asked:?}");
        }
    }
}
