//! Two sheets of triangles that are moved from various memory.

use crate::scenes::camera;
use abvh::{Hits, Mesh, MeshId, Point, Query, Scene, Step, Tracer, Update};

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

/// Two sheets on a device, whose vertices may lie in memory of its own.
pub(crate) trait Sheets: Sized {
    fn open(update: Update) -> Self;
    fn traced(&mut self) -> (&mut Tracer, [MeshId; 2]);
    /// Begins a step in which sheets are moved.
    fn moved(&mut self, moved: Moved) -> Step<'_>;

    /// What a camera sees after sheets were moved.
    fn see(&mut self, moved: Moved) -> Vec<Met> {
        let mut step = self.moved(moved);
        let query = step.trace(&camera(), Query::Closest).unwrap();
        let done = step.submit().unwrap();
        bits(self.traced().0.hits(done, query).unwrap())
    }
}

const STEPS: [Moved; 10] = [
    [Some((0.5, true)), None],
    [None, None],
    [Some((0.75, true)), Some((1.5, false))],
    [Some((0.25, false)), Some((1.75, true))],
    [None, Some((2.0, false))],
    [Some((1.25, true)), Some((0.75, true))],
    [None, Some((2.25, true))],
    // One vertex is outlying.
    [Some((-1e9, true)), None],
    [Some((f32::NAN, true)), Some((1.0, true))],
    [Some((0.5, false)), None],
];

/// Two of the same are moved step by step, one of them by the host alone: both see the same.
pub(crate) fn see_as_of_the_host<S: Sheets>() {
    for update in [Update::Async, Update::Rebuild, Update::DeviceRebuild] {
        let [mut found, mut expected] = [0; 2].map(|_| S::open(update));
        for moved in STEPS {
            let hosts = moved.map(|m| m.map(|(height, _)| (height, false)));
            assert!(
                found.see(moved) == expected.see(hosts),
                "{update:?} {moved:?}"
            );
        }
    }
}

/// Vertices stay while another mesh is replaced, even where no query has seen them yet: both of those that see the same, the
/// first with vertices of the device's.
pub(crate) fn stay_while_another_is_replaced<S: Sheets>() -> [S; 2] {
    let [mut found, mut expected] = [true, false].map(|on_device| {
        let mut own = S::open(Update::Auto);
        own.see([Some((0.5, on_device)), Some((1.0, on_device))]);
        let with = Mesh::streamed(&sheet(1.25)[..60], &triangles()[..76]).unwrap();
        let (tracer, [first, _]) = own.traced();
        let replacement = tracer.replace(first, with).unwrap();
        // A step that is dropped has moved it all the same.
        drop(own.moved([None, Some((2.0, on_device))]));
        own.traced().0.commit(replacement).unwrap();
        own
    });
    assert!(found.see([None, None]) == expected.see([None, None]));
    [found, expected]
}
