//! How much memory this process and its device hold.

use crate::stop::Stop;
use backend::{Backend, DeviceBytes, DeviceKind, Method};
use geom::Animation;
use host::Free;
use pipeline::{ExpectedMemory, TREE_BYTES, Update, trees_bytes};
use serde_json::{Value, json};

/// Memory of a device by what it holds, whole and a triangle.
pub(crate) fn device_memory(held: DeviceBytes, triangles: usize) -> Value {
    let parts = [held.tree, held.scratch, held.scene, held.frames];
    let named = |[tree, scratch, scene, frames]: [Value; 4]| json!({ "tree": tree, "scratch": scratch, "scene": scene, "frames": frames });
    let each = |bytes: u64| json!(bytes as f64 / triangles.max(1) as f64);
    json!({
        "bytes": named(parts.map(|bytes| json!(bytes))),
        "bytes_per_triangle": named(parts.map(each)),
    })
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
