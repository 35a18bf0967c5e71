//! Two sheets of triangles that are moved from various memory.

use abvh::{Hits, Mesh, MeshId, Point, Scene, Update};

/// What a ray met: the triangle, and where.
pub(crate) type Met = Option<(u32, [u32; 3])>;

/// Where each sheet is moved to, if it is, and whether from memory of the device's.
pub(crate) type Moved = [Option<(f32, bool)>; 2];

/// A sheet of triangles, at some height and somewhat bent.
pub(crate) fn sheet(height: f32) -> Vec<Point> {
    let at = |i: u32| (i % 20) as f32 - 9.5;
    let bend = |i: u32| height + 0.1 * (i as f32 * height).sin();
    let point = |i: u32| [at(i), bend(i), at(i / 20)];
    (0..400).map(point).collect()
}

pub(crate) fn triangles() -> Vec<[u32; 3]> {
    let corners = (0..380).filter(|i| i % 20 != 19);
    let both = |i: u32| [[i, i + 1, i + 20], [i + 1, i + 21, i + 20]];
    corners.flat_map(both).collect()
}

/// Two sheets.
pub(crate) fn scene() -> (Scene, [MeshId; 2]) {
    let mut scene = Scene::new();
    let sheets = [0.0, 1.0].map(|height| {
        let mesh = Mesh::streamed(&sheet(height), &triangles());
        scene.add(mesh.unwrap())
    });
    (scene, sheets)
}

pub(crate) fn bits(hits: Hits<'_>) -> Vec<Met> {
    let hit = |ray| {
        let hit = hits.closest(ray)?;
        let numbers = [hit.t, hit.u, hit.v].map(f32::to_bits);
        Some((hit.mesh.index() as u32 * 1000 + hit.triangle, numbers))
    };
    (0..hits.len()).map(hit).collect()
}

/// Two of the same are moved step by step, one of them by the host alone: both see the same.
pub(crate) fn see_as_of_the_host<S>(
    open: fn(Update) -> S,
    step: fn(&mut S, Moved) -> Vec<Met>,
    steps: &[Moved],
) {
    for update in [Update::Async, Update::Rebuild] {
        let [mut found, mut expected] = [0; 2].map(|_| open(update));
        for &moved in steps {
            let seen = step(&mut found, moved);
            let hosts = moved.map(|m| m.map(|(height, _)| (height, false)));
            assert!(seen == step(&mut expected, hosts), "{update:?} {moved:?}");
        }
    }
}
