//! Tests of vertices, rays and results in device memory. They run on the caller's wgpu device (`wgpu_*.rs`), and on
//! Vulkan with memory shared with another device or CUDA (`external.rs`, `cuda.rs`).

use crate::scenes::{camera, rays, swarm};
use abvh::{
    Device, Hits, Mesh, MeshId, Point, Query, QueryId, Ray, Scene, Source, Step, Tracer, Update,
};
use integration::stage::vast_camera;
use std::iter::zip;

/// Hit of a ray: the bits of `t`, `u` and `v`, and the triangle plus 1000 times the mesh. All zero for any-hit queries.
pub(crate) type Found = Option<[u32; 4]>;

/// New height of each moved sheet, and `true` if its vertices are in device memory.
pub(crate) type Moved = [Option<(f32, bool)>; 2];

/// A slightly bent sheet of triangles at `height`.
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

/// Creates a scene of two sheets.
pub(crate) fn two_sheets() -> (Scene, [MeshId; 2]) {
    let mut scene = Scene::new();
    let sheets = [0.0, 1.0].map(|height| {
        let mesh = Mesh::streamed(&sheet(height), &triangles());
        scene.add(mesh.unwrap())
    });
    (scene, sheets)
}

pub(crate) fn bits(hits: Hits) -> Vec<Found> {
    let hit = |ray| {
        let hit = hits.closest(ray)?;
        let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
        Some([t, u, v, hit.mesh.index() as u32 * 1000 + hit.triangle])
    };
    (0..hits.len()).map(hit).collect()
}

/// Two sheets on a device, with vertices in device or host memory.
pub(crate) trait Sheets: Sized {
    fn open(update: Update) -> Self;
    fn traced(&mut self) -> (&mut Tracer, [MeshId; 2]);
    /// Begins a step that moves sheets.
    fn moved(&mut self, moved: Moved) -> Step<'_>;

    /// Returns the hits of a camera after sheets were moved.
    fn see(&mut self, moved: Moved) -> Vec<Found> {
        let mut step = self.moved(moved);
        let query = step.trace(&camera(), Query::Closest).unwrap();
        let done = step.submit().unwrap();
        bits(self.traced().0.hits(done, query).unwrap())
    }

    /// Returns a picture after sheets were moved.
    fn shown(&mut self, moved: Moved) -> Vec<u8> {
        let mut step = self.moved(moved);
        let picture = step.render(&camera(), [3.0, 9.0, -4.0]).unwrap();
        let done = step.submit().unwrap();
        let mut rgba = Vec::new();
        self.traced().0.pixels(done, picture, &mut rgba).unwrap();
        rgba
    }
}

/// Two sheets on the host, with vertices in host memory only.
pub(crate) struct OnHost(Tracer, [MeshId; 2]);

impl Sheets for OnHost {
    fn open(update: Update) -> Self {
        let (scene, sheets) = two_sheets();
        let builder = Tracer::builder().device(Device::Cpu).update(update);
        Self(builder.threads(2).build(scene).unwrap(), sheets)
    }

    fn traced(&mut self) -> (&mut Tracer, [MeshId; 2]) {
        (&mut self.0, self.1)
    }

    fn moved(&mut self, moved: Moved) -> Step<'_> {
        let mut step = self.0.step(0.0);
        for (mesh, moved) in zip(self.1, moved) {
            if let Some((height, _)) = moved {
                let points = sheet(height);
                step.vertices(mesh, Source::Host(&points)).unwrap();
            }
        }
        step
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
    // The vertices of the first sheet are outlying.
    [Some((-1e9, true)), None],
    [Some((f32::NAN, true)), Some((1.0, true))],
    [Some((0.5, false)), None],
];

/// Checks that sheets moved step by step have the same hits and pictures as on the host.
pub(crate) fn check_vertices_match_host<S: Sheets>() {
    for update in [
        Update::Async,
        Update::Rebuild,
        Update::DeviceRebuild,
        Update::Lockstep(1),
    ] {
        let (mut found, mut expected) = (S::open(update), OnHost::open(Update::Async));
        for (i, moved) in STEPS.into_iter().enumerate() {
            // A picture needs the range of the vertices for its shadow rays. Most steps trace without a picture.
            for moved in [moved, [None, None]] {
                let is_same = match i % 3 {
                    1 => found.shown(moved) == expected.shown(moved),
                    _ => true,
                };
                let is_same = is_same && found.see(moved) == expected.see(moved);
                assert!(is_same, "{update:?} {moved:?}");
            }
        }
    }
}

/// Checks that device vertices and memory stay valid while another mesh is replaced.
pub(crate) fn check_vertices_survive_replacement<S: Sheets>() {
    for is_traced in [false, true] {
        let mut found = one_replaced::<S>(is_traced);
        let mut expected = one_replaced::<OnHost>(is_traced);
        let moved = [None, Some((0.25, false)), Some((0.75, true))];
        for moved in moved.map(|second| [None, second]) {
            assert!(found.see(moved) == expected.see(moved), "{moved:?}");
        }
    }
}

/// Replaces a sheet after a step that moves the other one and is dropped, or whose query is refused.
fn one_replaced<S: Sheets>(is_traced: bool) -> S {
    let mut own = S::open(Update::Async);
    own.see([Some((0.5, true)), Some((1.0, true))]);
    let with = Mesh::streamed(&sheet(1.25)[..60], &triangles()[..76]).unwrap();
    let (tracer, [first, _]) = own.traced();
    let replacement = tracer.replace(first, with).unwrap();
    // Updates of such a step still apply.
    let mut step = own.moved([None, Some((2.0, true))]);
    if is_traced {
        step.trace(&vast_camera(), Query::Closest).unwrap();
        step.submit().unwrap_err();
    } else {
        drop(step);
    }
    own.traced().0.commit(replacement).unwrap();
    own
}

/// A tracer, rays, and a buffer for results.
pub(crate) trait RaysOnDevice {
    fn tracer(&mut self) -> &mut Tracer;
    /// Returns the hits of the rays, with or without writing results to the buffer.
    fn trace(&mut self, query: Query, has_results: bool) -> Vec<Found>;
    fn fill_results(&mut self, byte: u8);
    /// Returns the first `words` words of the results.
    fn results(&mut self, words: usize) -> Vec<u32>;
}

/// Returns the hits of a query in a step.
pub(crate) fn found(
    tracer: &mut Tracer,
    query: Query,
    ask: impl FnOnce(&mut Step<'_>) -> abvh::Result<QueryId>,
) -> Vec<Found> {
    let mut step = tracer.step(0.5);
    let asked = ask(&mut step).unwrap();
    let done = step.submit().unwrap();
    let hits = tracer.hits(done, asked).unwrap();
    if query == Query::Any {
        let hit = |ray| hits.is_hit(ray).then_some([0; 4]);
        return (0..hits.len()).map(hit).collect();
    }
    bits(hits)
}

/// Creates a scene of triangles that move.
pub(crate) fn flying() -> Scene {
    let swarm = swarm(300);
    let keys = (0..3).map(|key| swarm.key(key).unwrap().to_vec());
    let mut scene = Scene::new();
    scene.add(Mesh::keyframes(keys.collect::<Vec<_>>(), swarm.triangles()).unwrap());
    scene
}

/// Creates a scene that no ray can hit.
pub(crate) fn nothing() -> Scene {
    let mut nothing = Scene::new();
    let nowhere = [[f32::NAN; 3]; 3];
    nothing.add(Mesh::fixed(&nowhere, &[[0, 1, 2]]).unwrap());
    nothing
}

/// Rays of all kinds. Some cannot hit anything, and some start far away.
pub(crate) fn all_kinds() -> Vec<Ray> {
    let mut all = rays(1000);
    let spoil: [fn(&mut Ray); 12] = [
        |ray| ray.direction = [0.0, -0.0, 0.0],
        |ray| ray.direction[1] = f32::NAN,
        |ray| ray.direction[2] = f32::INFINITY,
        |ray| ray.origin[0] = f32::NAN,
        |ray| ray.origin[1] = f32::NEG_INFINITY,
        |ray| ray.t_min = f32::NAN,
        |ray| ray.t_max = -f32::NAN,
        |ray| (ray.t_min, ray.t_max) = (1.5, 0.5),
        |ray| (ray.t_min, ray.t_max) = (-0.0, 0.0),
        |ray| (ray.t_min, ray.t_max) = (f32::INFINITY, f32::NEG_INFINITY),
        // These are valid, but need exact arithmetic.
        |ray| (ray.origin, ray.direction) = ([-1e30, 0.01, 0.02], [1.0, 0.0, 0.0]),
        |ray| (ray.origin, ray.direction) = ([0.1, 3e38, 0.0], [0.0, -1.0, 1e-30]),
    ];
    for (i, ray) in all.iter_mut().enumerate() {
        if i % 3 == 0 {
            spoil[i / 3 % spoil.len()](ray);
        }
    }
    // Rays through vertices of `flying`, which error bounds cannot decide.
    let (swarm, eye) = (swarm(300), [0.0, 9.0, 0.0]);
    let vertices = swarm.at(0.5).unwrap();
    let to_vertex = |v| {
        let to = vertices.vertex(v);
        Ray::new(eye, std::array::from_fn(|i| to[i] - eye[i]))
    };
    all.extend((0..300).map(to_vertex));
    all
}

/// Checks that lent rays have the same hits and results as rays of the host, whatever the buffer of results held
/// before. Returns the last `L`. Its last query was for closest hits, and some rays hit.
pub(crate) fn check_rays_match_host<L: RaysOnDevice>(open: impl Fn(Scene, &[Ray]) -> L) -> L {
    let list = all_kinds();
    let [_, last] = [(nothing(), false), (flying(), true)].map(|(scene, hits_some)| {
        let mut lent = open(scene, &list);
        for query in [Query::Any, Query::Closest] {
            let expected = found(lent.tracer(), query, |step| step.trace(&list, query));
            assert_eq!(expected.iter().flatten().count() > 100, hits_some);
            lent.fill_results(7);
            for has_results in [false, true] {
                let seen = lent.trace(query, has_results);
                assert!(seen == expected, "{query:?} {has_results}");
            }
            let miss = [f32::INFINITY.to_bits(), 0, 0, u32::MAX];
            if query == Query::Any {
                let words = lent.results(4 * list.len());
                let (results, unused) = words.split_at(list.len());
                let met = results.iter().map(|&word| word != 0);
                assert!(met.eq(expected.iter().map(Option::is_some)));
                // The rest of the buffer belongs to the caller and must not change.
                assert!(unused.iter().all(|&word| word == 0x0707_0707));
            } else {
                let words: Vec<_> = expected.iter().map(|hit| hit.unwrap_or(miss)).collect();
                assert!(lent.results(4 * list.len()) == words.as_flattened());
            }
        }
        lent
    });
    last
}
