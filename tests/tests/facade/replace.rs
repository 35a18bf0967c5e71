//! Tests that replace meshes by meshes with other triangles, while the scene is traced.

use crate::pool::{self, tracer};
use crate::{Demo, Found, bits, demo, hits_after, hits_at, scene_of};
use abvh::own_device::{required_features, required_limits};
use abvh::{
    Device, Error, Mesh, MeshId, Point, Query, QueryId, Ray, Scene, Source, Step, StepId, Tracer,
    Update,
};
use integration::stage::own_device_with;

/// The demo of a scene's original meshes, and the demo of their replacements.
struct MeshSources {
    original: Demo,
    replacement: Demo,
}

/// Ids of a scene's meshes.
#[derive(Clone, Copy)]
struct Ids {
    robot: MeshId,
    target: MeshId,
    cloth: MeshId,
}

/// How the replaced mesh, or its replacement, moves.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Fixed,
    Keys,
    Streamed,
    Rigid,
}

fn raised(points: &[Point], by: f32) -> Vec<Point> {
    points.iter().map(|p| [p[0], p[1] + by, p[2]]).collect()
}

impl MeshSources {
    fn new() -> Self {
        let [original, mut replacement] = ["demo:twist:1000", "demo:twist:300"].map(demo);
        let keys = replacement.keys.iter().map(|key| raised(key, 0.3));
        replacement.keys = keys.collect();
        Self {
            original,
            replacement,
        }
    }

    /// Creates the mesh to replace, or its replacement.
    fn target(&self, is_new: bool, kind: Kind) -> Mesh {
        let of = match is_new {
            true => &self.replacement,
            false => &self.original,
        };
        let (keys, triangles) = (&of.keys, &of.triangles);
        let parts = vec![0; keys[0].len()];
        let made = match kind {
            Kind::Fixed => Mesh::fixed(&keys[0], triangles),
            Kind::Keys => Mesh::keyframes(keys.clone(), triangles),
            Kind::Streamed => Mesh::streamed(&keys[0], triangles),
            Kind::Rigid => Mesh::rigid(&keys[0], triangles, &parts),
        };
        made.unwrap()
    }

    /// Creates a scene of a rigid mesh, the target, a key-framed mesh and a streamed mesh.
    fn scene(&self, target: Mesh) -> (Scene, Ids) {
        let (low, high) = (
            raised(&self.original.keys[0], -0.5),
            raised(&self.original.keys[0], 0.8),
        );
        let keys = self
            .original
            .keys
            .iter()
            .map(|key| raised(key, -0.2))
            .collect();
        let robot = Mesh::rigid(&low, &self.original.triangles, &vec![0; low.len()]).unwrap();
        let keyed = Mesh::keyframes(keys, &self.original.triangles).unwrap();
        let cloth = Mesh::streamed(&high, &self.original.triangles).unwrap();
        let (scene, [robot, target, _, cloth]) = scene_of([robot, target, keyed, cloth]);
        let ids = Ids {
            robot,
            target,
            cloth,
        };
        (scene, ids)
    }

    /// Submits a step that moves the streamed and the rigid mesh and traces.
    fn advance(&self, tracer: &mut Tracer, ids: Ids, i: usize) -> (StepId, QueryId) {
        let mut step = tracer.step(time(i));
        let cloth = self.cloth(i);
        step.vertices(ids.cloth, Source::Host(&cloth)).unwrap();
        step.poses(ids.robot, &[shift(i)]).unwrap();
        let query = step.trace(&self.original.rays, Query::Closest).unwrap();
        (step.submit().unwrap(), query)
    }

    fn cloth(&self, i: usize) -> Vec<Point> {
        raised(
            &self.original.keys[i % self.original.keys.len()],
            0.05 * cycle(i),
        )
    }

    /// Moves the target as well, and returns the hits.
    fn follow(&self, tracer: &mut Tracer, ids: Ids, (i, kind): (usize, Kind)) -> Found {
        let mut step = tracer.step(time(i));
        let target = &self.replacement.keys[i % self.replacement.keys.len()];
        match kind {
            Kind::Streamed => step.vertices(ids.target, Source::Host(target)).unwrap(),
            Kind::Rigid => step.poses(ids.target, &[shift(i)]).unwrap(),
            Kind::Fixed | Kind::Keys => {}
        }
        drop(step);
        let asked = self.advance(tracer, ids, i);
        found(tracer, asked)
    }
}

fn time(i: usize) -> f64 {
    0.3 * i as f64
}

/// Returns a value that changes with the step, but stays so small that all meshes remain in the picture.
fn cycle(i: usize) -> f32 {
    (i % 12) as f32
}

fn shift(i: usize) -> abvh::Matrix {
    let by = 0.03 * cycle(i);
    [
        [1.0, 0.0, 0.0, by],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, by],
    ]
}

fn found(tracer: &mut Tracer, (step, query): (StepId, QueryId)) -> Found {
    bits(tracer.hits(step, query).unwrap())
}

/// Replaces a mesh and commits at once.
fn exchange(tracer: &mut Tracer, mesh: MeshId, with: Mesh) {
    let replacement = tracer.replace(mesh, with).unwrap();
    tracer.commit(replacement).unwrap();
}

/// Tests replacement in a scene of meshes of all kinds, which move before and after the commit.
pub(crate) fn replaced_mesh_matches_new_scene(device: &Device) {
    let sources = MeshSources::new();
    for (before, after, update) in [
        (Kind::Streamed, Kind::Streamed, Update::Async),
        (Kind::Fixed, Kind::Keys, Update::Refit),
        (Kind::Keys, Kind::Rigid, Update::Rebuild),
    ] {
        let build = |scene| pool::build(Tracer::builder().update(update), scene, device);
        let (scene, ids) = sources.scene(sources.target(false, before));
        let (mut live, mut twin) = (build(scene.clone()), build(scene));
        sources.advance(&mut live, ids, 0);
        let (mesh, mut i) = (sources.target(true, after), 1);
        let replacement = live.replace(ids.target, mesh.clone()).unwrap();
        while i < 4 || !replacement.is_ready() {
            let asked = sources.advance(&mut live, ids, i);
            let expected = sources.advance(&mut twin, ids, i);
            let expected = found(&mut twin, expected);
            assert!(found(&mut live, asked) == expected, "{before:?} at {i}");
            i += 1;
        }
        // A step that is dropped before any query still moves its meshes.
        let cloth = sources.cloth(i + 1);
        let mut step = live.step(time(i));
        step.vertices(ids.cloth, Source::Host(&cloth)).unwrap();
        drop(step);
        let trees = live.statistics().unwrap().generation;
        live.commit(replacement).unwrap();

        let (scene, new) = sources.scene(mesh);
        let mut fresh = build(scene);
        let mut step = fresh.step(time(i));
        step.vertices(new.cloth, Source::Host(&cloth)).unwrap();
        step.poses(new.robot, &[shift(i - 1)]).unwrap();
        drop(step);
        let expected = hits_at(&mut fresh, time(i), &sources.original.rays);
        let all = hits_at(&mut live, time(i), &sources.original.rays);
        assert!(all == expected, "{after:?} at once");
        assert!(live.statistics().unwrap().generation > trees);
        for mesh in 0..4 {
            let hits = all.iter().filter(|hit| hit[0] == mesh);
            assert!(hits.count() > 10, "mesh {mesh} is seen");
        }
        for i in i + 1..i + 5 {
            let expected = sources.follow(&mut fresh, new, (i, after));
            let all = sources.follow(&mut live, ids, (i, after));
            assert!(all == expected, "{after:?} at {i}");
        }
    }
}

/// Tests one tracer after replacements that change which kinds of motion the scene has.
pub(crate) fn replacement_may_change_motion_kind(device: &Device) {
    let sources = MeshSources::new();
    let fixed = |by| {
        Mesh::fixed(
            &raised(&sources.original.keys[0], by),
            &sources.original.triangles,
        )
        .unwrap()
    };
    let (scene, [target, _]) = scene_of([sources.target(false, Kind::Fixed), fixed(-0.5)]);
    let mut live = tracer(scene, device);
    hits_at(&mut live, 0.0, &sources.original.rays);
    for (is_new, kind) in [
        (true, Kind::Streamed),
        (false, Kind::Keys),
        (true, Kind::Fixed),
        (false, Kind::Rigid),
    ] {
        let mesh = sources.target(is_new, kind);
        exchange(&mut live, target, mesh.clone());
        let (scene, [same, _]) = scene_of([mesh, fixed(-0.5)]);
        let mut fresh = tracer(scene, device);
        for at in [0.0, 1.5] {
            for (tracer, mesh) in [(&mut live, target), (&mut fresh, same)] {
                let mut step = tracer.step(at);
                let poses = step.poses(mesh, &[shift(3)]);
                let what = "matrices";
                let refused = Err(Error::Motion { mesh, what });
                assert_eq!(poses, if kind == Kind::Rigid { Ok(()) } else { refused });
                let there = match kind {
                    Kind::Streamed => step.vertices_mut(mesh).map(|to| to.reverse()),
                    _ => Ok(()),
                };
                there.unwrap();
            }
            let expected = hits_at(&mut fresh, at, &sources.original.rays);
            let all = hits_at(&mut live, at, &sources.original.rays);
            assert!(all == expected, "{kind:?} at {at}");
        }
    }
}

pub(crate) fn results_survive_steps_and_commits(device: &Device) {
    let sources = MeshSources::new();
    let (scene, ids) = sources.scene(sources.target(false, Kind::Fixed));
    let mut twin = tracer(scene.clone(), device);
    let expected = [0, 1].map(|i| {
        let asked = sources.advance(&mut twin, ids, i);
        found(&mut twin, asked)
    });
    let mut live = tracer(scene, device);
    let of_old = [0, 1].map(|i| sources.advance(&mut live, ids, i));
    // Replaces twice, without a step in between.
    for is_new in [true, false] {
        let mesh = sources.target(is_new, Kind::Streamed);
        exchange(&mut live, ids.target, mesh);
    }
    for (asked, expected) in of_old.into_iter().zip(&expected) {
        assert!(found(&mut live, asked) == *expected);
    }
    let none = |live: &mut Tracer, (step, query)| live.hits(step, query).err();
    let later = sources.advance(&mut live, ids, 2);
    // Results are not available under the id of another step's query either.
    for asked in [of_old[0], (of_old[1].0, later.1)] {
        assert_eq!(none(&mut live, asked), Some(Error::NoResult));
    }
    assert!(found(&mut live, of_old[1]) == expected[1]);
    assert_eq!(found(&mut live, later).len(), sources.original.rays.len());
    sources.advance(&mut live, ids, 3);
    assert_eq!(none(&mut live, of_old[1]), Some(Error::NoResult));
}

/// Tests on a device of the caller. All scenes share it, and its hit buffers stay valid as long as results do.
pub(crate) fn replaces_meshes_on_caller_device(_: &Device) {
    let sources = MeshSources::new();
    let (scene, ids) = sources.scene(sources.target(false, Kind::Fixed));
    let limits = required_limits(&scene, sources.original.rays.len()).unwrap();
    let device = own_device_with(required_features(), limits);
    replaced_mesh_matches_new_scene(&Device::from(device.clone()));
    let mut live = tracer(scene, &Device::from(device));
    let before = sources.advance(&mut live, ids, 0);
    let mesh = sources.target(true, Kind::Streamed);
    let grown = mesh.triangle_count() as u32;
    exchange(&mut live, ids.target, mesh);
    let after = sources.advance(&mut live, ids, 1);
    let buffers = [before, after].map(|(step, query)| live.hits_buffer(step, query));
    let [old, new] = buffers.map(Result::unwrap);
    assert!(old != new);
    let mesh = sources.original.triangles.len() as u32;
    let firsts = [ids.robot, ids.target, ids.cloth].map(|id| live.first_triangle(id).unwrap());
    assert_eq!(firsts, [0, mesh, mesh + grown + mesh]);
}

/// The second tracer keeps the device of the first one and ignores that of its own builder.
pub(crate) fn replaces_meshes_after_build_in_place(_: &Device) {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = || Mesh::fixed(&points, &[[0, 1, 2]]).unwrap();
    let mut scene = Scene::new();
    let id = scene.add(mesh());
    let builder = || Tracer::builder().threads(1);
    let former = builder().device(Device::CpuRef).build(scene.clone());
    let mut tracer = builder().build_in_place_of(former.unwrap(), scene).unwrap();
    let replacement = tracer.replace(id, mesh()).unwrap();
    tracer.commit(replacement).unwrap();
}

pub(crate) fn dropped_replacements_change_nothing(device: &Device) {
    let sources = MeshSources::new();
    let (scene, ids) = sources.scene(sources.target(false, Kind::Keys));
    let (mut live, mut twin) = (tracer(scene.clone(), device), tracer(scene, device));
    let early = live.replace(ids.target, sources.target(true, Kind::Fixed));
    drop(early.unwrap());
    let late = (live.replace(ids.target, sources.target(true, Kind::Fixed))).unwrap();
    while !late.is_ready() {
        std::thread::yield_now();
    }
    drop(late);
    for i in 0..3 {
        let asked = [&mut live, &mut twin].map(|tracer| sources.advance(tracer, ids, i));
        assert!(found(&mut live, asked[0]) == found(&mut twin, asked[1]));
    }
    // A dropped replacement does not block later ones.
    let mesh = sources.target(true, Kind::Fixed);
    exchange(&mut live, ids.target, mesh.clone());
    let (scene, new) = sources.scene(mesh);
    let expected = sources.follow(&mut tracer(scene, device), new, (3, Kind::Fixed));
    assert!(sources.follow(&mut live, ids, (3, Kind::Fixed)) == expected);
    // A replacement may outlive its tracer.
    let orphan = live.replace(ids.target, sources.target(true, Kind::Fixed));
    drop(live);
    assert_eq!(orphan.unwrap().mesh(), ids.target);
}

/// Tests two replacements at a time, in either order, while a third mesh moves.
pub(crate) fn supports_two_concurrent_replacements(device: &Device) {
    let [low, other] = ["demo:twist:1000", "demo:twist:300"].map(demo);
    let at = |of: &Demo, by: f32| raised(&of.keys[0], by);
    let fixed = |of: &Demo, by: f32| Mesh::fixed(&at(of, by), &of.triangles).unwrap();
    let cloth = || Mesh::streamed(&at(&low, 0.8), &low.triangles).unwrap();
    for first in [0, 1] {
        let (scene, ids) = scene_of([fixed(&low, 0.0), fixed(&low, -0.5), cloth()]);
        let mut live = tracer(scene, device);
        let with = [fixed(&other, 0.1), fixed(&other, -0.4)];
        let replace = |i: usize| live.replace(ids[i], with[i].clone()).unwrap();
        let [one, two] = [first, 1 - first].map(replace);
        live.commit(one).unwrap();
        let moved = at(&low, 0.3);
        let moves = |step: &mut Step<'_>, cloth| step.vertices(cloth, Source::Host(&moved));
        hits_after(&mut live, 0.0, &low.rays, |step| moves(step, ids[2]));
        live.commit(two).unwrap();
        let found = hits_at(&mut live, 0.0, &low.rays);
        let [a, b] = with;
        let (scene, [.., cloth]) = scene_of([a, b, cloth()]);
        let mut anew = tracer(scene, device);
        let expected = hits_after(&mut anew, 0.0, &low.rays, |step| moves(step, cloth));
        assert!(found == expected, "mesh {first} first");
    }
}

pub(crate) fn invalid_replacements_are_errors(device: &Device) {
    let (points, triangles) = ([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
    let mesh = || Mesh::fixed(&points, &triangles).unwrap();
    let (scene, [one, two]) = scene_of([mesh(), mesh()]);
    // Two tracers of the same scene.
    let (mut live, mut other) = (tracer(scene.clone(), device), tracer(scene, device));
    let foreign = Scene::new().add(mesh());
    let refused = live.replace(foreign, mesh()).err();
    assert_eq!(refused, Some(Error::ForeignMesh(foreign)));
    let lent = other.replace(one, mesh()).unwrap();
    assert_eq!(live.commit(lent), Err(Error::ForeignReplacement(one)));
    let [first, second] = [one, one].map(|id| live.replace(id, mesh()).unwrap());
    live.commit(first).unwrap();
    assert_eq!(live.commit(second), Err(Error::Conflict(one)));
    // Replacements without triangles, and with vertices that are all NaN.
    let nowhere = Mesh::streamed(&[[f32::NAN; 3]; 3], &triangles).unwrap();
    for mesh in [Mesh::fixed(&[], &[]).unwrap(), nowhere] {
        for id in [one, two] {
            exchange(&mut live, id, mesh.clone());
        }
        let ray = [Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0])];
        assert_eq!(hits_at(&mut live, 0.0, &ray), [[u32::MAX; 5]]);
        let mut step = other.step(0.0);
        let query = step.trace(&ray, Query::Any).unwrap();
        let done = step.submit().unwrap();
        assert!(other.hits(done, query).unwrap().is_hit(0));
    }
}
