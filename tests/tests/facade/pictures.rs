//! Tests several cameras in a step, and pictures.

use crate::{Demo, Found, bits, demo, of_keys, pool, scene_of};
use abvh::frames::LitView;
use abvh::{
    Camera, CameraPose, Device, Error, Hits, Mesh, Point, Query, Scene, SceneHit, Source, Tracer,
};
use integration::stage::{camera, colours, host};

const FLOOR: [Point; 3] = [[-5.0, -0.6, -5.0], [5.0, -0.6, -5.0], [0.0, -0.6, 5.0]];
const FLOOR_COLOUR: [u8; 3] = [200, 20, 90];
const LAMP: Point = [2.0, 4.0, 1.5];

/// Returns a camera's view under the lamp.
pub(crate) fn lit(camera: &Camera) -> LitView<'_> {
    LitView {
        camera,
        light: LAMP,
    }
}

/// Renders a single-coloured floor under a mesh of many colours, on the host.
fn expected(cloth: &Demo, vertices: &[Point], camera: &Camera) -> Vec<u8> {
    let all = [&FLOOR, vertices].concat();
    let triangles = cloth.triangles.iter().map(|t| t.map(|v| v + 3));
    let triangles: Vec<_> = std::iter::once([0, 1, 2]).chain(triangles).collect();
    let own = colours(cloth.triangles.len());
    let own = [&[FLOOR_COLOUR][..], &own].concat();
    let mesh = Mesh::fixed(&all, &triangles).unwrap();
    let mut reference = reference(mesh.with_colours(&own).unwrap());
    let shown = shown(&mut reference, 0.0, lit(camera));
    assert!(shown.blocked.contains(&1) && shown.blocked.contains(&0));
    shown.rgba
}

/// Returns a tracer of one mesh on the scalar reference.
fn reference(mesh: Mesh) -> Tracer {
    let tracer = Tracer::builder().build_on(Box::new(host()), scene_of([mesh]).0);
    tracer.unwrap()
}

/// Creates a static mesh of many colours.
fn coloured(vertices: &[Point], triangles: &[[u32; 3]]) -> Mesh {
    let mesh = Mesh::fixed(vertices, triangles).unwrap();
    mesh.with_colours(&colours(triangles.len())).unwrap()
}

fn floor() -> Mesh {
    let floor = Mesh::fixed(&FLOOR, &[[0, 1, 2]]).unwrap();
    floor.with_colours(&[FLOOR_COLOUR]).unwrap()
}

/// Checks pictures of streamed and key-framed meshes, in steps with other queries. Results last until two more steps
/// are submitted.
pub(crate) fn pictures_match_host_bytes(device: &Device) {
    let demo = demo("demo:twist:2000");
    let own = colours(demo.triangles.len());
    let sizes = [[40, 30], [33, 20], [64, 50]];
    let cameras = sizes.map(|size| camera(&demo.animation, size));
    let live = Mesh::streamed(&demo.keys[0], &demo.triangles).unwrap();
    let keyed = Mesh::keyframes(demo.keys.clone(), &demo.triangles).unwrap();
    for (mesh, is_live) in [(live, true), (keyed, false)] {
        let (scene, [_, id]) = scene_of([floor(), mesh.with_colours(&own).unwrap()]);
        let mut tracer = pool::tracer(scene, device);
        let mut earlier = None;
        for (key, vertices) in demo.keys.iter().enumerate().step_by(3) {
            let mut step = tracer.step(key as f64);
            if is_live {
                step.vertices(id, Source::Host(vertices)).unwrap();
            }
            let first = step.render(&cameras[0], LAMP).unwrap();
            let list = step.trace(&demo.rays, Query::Closest).unwrap();
            let seen = step.trace(&cameras[1], Query::Closest).unwrap();
            let second = step.render(&cameras[1 + key % 2], LAMP).unwrap();
            let done = step.submit().unwrap();
            let asked = [(first, &cameras[0]), (second, &cameras[1 + key % 2])];
            let asked =
                asked.map(|(picture, camera)| (done, picture, expected(&demo, vertices, camera)));
            let mut rgba = vec![7];
            for (step, picture, expected) in asked.iter().chain(earlier.iter().flatten()) {
                tracer.pixels(*step, *picture, &mut rgba).unwrap();
                assert!(rgba == *expected, "{picture:?} at {key}");
            }
            for query in [list, seen] {
                let none = tracer.pixels(done, query, &mut rgba);
                assert_eq!(none, Err(Error::NoResult));
            }
            assert_eq!(tracer.hits(done, first).unwrap().len(), 1200);
            earlier = Some(asked);
        }
        let [(step, picture, _), _] = earlier.unwrap();
        for _ in 0..2 {
            tracer.step(0.0).submit().unwrap();
        }
        let dropped = tracer.pixels(step, picture, &mut Vec::new());
        assert_eq!(dropped, Err(Error::NoResult));
    }
}

/// Tests scenes of any size and triangles that no single scale suits, with lamps at any distance.
pub(crate) fn pictures_match_host_at_any_scale(device: &Device) {
    let demo = demo("demo:twist:300");
    let [outside, amid] = [([0.3, 0.2, 3.0], 50.0), ([0.1, 0.0, -0.1], 120.0)];
    for by in [1e-36, 1e-12, 1.0, 1e9, 1e30] {
        let scaled = |p: Point| p.map(|x| x * by);
        let vertices: Vec<Point> = demo.keys[1].iter().map(|&p| scaled(p)).collect();
        let lights = [
            scaled(outside.0),
            [f32::MAX, 0.0, 1.0],
            [1e-40, -1e-38, 0.0],
        ];
        let shots = [outside, amid].map(|(eye, fov)| lights.map(|light| (scaled(eye), fov, light)));
        let mesh = coloured(&vertices, &demo.triangles);
        still(device, &mesh, &shots.concat());
    }
    let corners = |s: f32| [[-s, -s, -s], [s, -s, 0.5 * s], [0.1 * s, s, -s]];
    let mixed = [1.0, 1e-30, 1e30, 1e-3].map(corners).concat();
    let shots = [3e-30, 3.0, 3e3, 3e30].map(|far| ([0.0, 0.1 * far, far], 60.0, LAMP));
    let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
    still(device, &coloured(&mixed, &triangles), &shots);
}

/// Tests a static mesh, for several eyes, fields of view and lamps.
fn still(device: &Device, mesh: &Mesh, shots: &[(Point, f32, Point)]) {
    let mut tracer = pool::tracer(scene_of([mesh.clone()]).0, device);
    let mut reference = reference(mesh.clone());
    for &(eye, fov, light) in shots {
        let camera =
            Camera::look_at(CameraPose::new(eye, [0.0; 3]).with_fov(fov), [66, 62]).unwrap();
        let view = LitView {
            camera: &camera,
            light,
        };
        let expected = shown(&mut reference, 0.0, view);
        let is_hit = |&triangle: &u32| triangle != SceneHit::MISS.triangle;
        assert!(expected.triangles.iter().any(is_hit), "{eye:?}");
        let found = shown(&mut tracer, 0.0, view);
        assert!(found == expected, "from {eye:?} under {light:?}");
    }
}

/// Checks that colours stay with a mesh when others are replaced, and that a new mesh brings its own.
pub(crate) fn meshes_keep_their_colours(device: &Device) {
    let demo = demo("demo:twist:300");
    let mesh = coloured(&demo.keys[1], &demo.triangles);
    let (scene, [_, id]) = scene_of([floor(), Mesh::fixed(&FLOOR, &[]).unwrap()]);
    let mut tracer = pool::tracer(scene, device);
    let camera = camera(&demo.animation, [40, 30]);
    let before = picture(&mut tracer, &camera);
    let replacement = tracer.replace(id, mesh).unwrap();
    tracer.commit(replacement).unwrap();
    let after = picture(&mut tracer, &camera);
    assert!(after == expected(&demo, &demo.keys[1], &camera));
    assert!(before != after);
}

fn picture(tracer: &mut Tracer, camera: &Camera) -> Vec<u8> {
    shown(tracer, 0.0, lit(camera)).rgba
}

/// A picture, and for each pixel the triangle that it shows and whether that point is in shadow.
#[derive(Debug, PartialEq)]
pub(crate) struct Shown {
    pub(crate) rgba: Vec<u8>,
    pub(crate) triangles: Vec<u32>,
    pub(crate) blocked: Vec<u8>,
}

/// Returns the picture of a step.
pub(crate) fn shown(tracer: &mut Tracer, time: f64, view: LitView<'_>) -> Shown {
    let mut step = tracer.step(time);
    let picture = step.render(view.camera, view.light).unwrap();
    let done = step.submit().unwrap();
    let mut rgba = Vec::new();
    tracer.pixels(done, picture, &mut rgba).unwrap();
    let hits = tracer.hits(done, picture).unwrap();
    let triangles = hits.in_scene().iter().map(|hit| hit.triangle);
    Shown {
        rgba,
        triangles: triangles.collect(),
        blocked: hits.any().to_vec(),
    }
}

/// Returns all information about a query's hits.
fn all_results(hits: Hits) -> (Vec<bool>, Found) {
    let met = (0..hits.len()).map(|ray| hits.is_hit(ray));
    (met.collect(), bits(hits))
}

/// Tests cameras in one submission, together with a list of rays. Steps have different numbers of cameras. Results
/// last until two more steps are submitted.
pub(crate) fn batched_cameras_match_separate_steps(device: &Device) {
    let demo = demo("demo:collide:3000");
    let [mut together, mut alone] = [0; 2].map(|_| of_keys(&demo, device));
    let sizes = [[40, 30], [1, 1], [64, 3], [40, 30], [17, 90]];
    let cameras = sizes.map(|size| camera(&demo.animation, size));
    let kinds = [Query::Closest, Query::Any];
    let all = |count: usize| (0..count).map(|i| (cameras[i % 5], kinds[i % 2]));
    let mut asked = Vec::new();
    for (time, count) in [3, 9, 1, 0, 17, 2, 9, 9].into_iter().enumerate() {
        let mut step = together.step(time as f64);
        let mut queries = Vec::new();
        for (i, (camera, kind)) in all(count).enumerate() {
            if i == 1 {
                step.trace(&demo.rays, Query::Closest).unwrap();
            }
            queries.push(step.trace(&camera, kind).unwrap());
        }
        let done = step.submit().unwrap();
        for (query, (camera, kind)) in queries.into_iter().zip(all(count)) {
            let mut step = alone.step(time as f64);
            let one = step.trace(&camera, kind).unwrap();
            let one_done = step.submit().unwrap();
            let expected = all_results(alone.hits(one_done, one).unwrap());
            asked.push((time, done, query, expected));
        }
        asked.retain(|(of, ..)| of + 1 >= time);
        // The previous step comes first. In two of three steps, its results have not been read yet.
        for (of, done, query, expected) in &asked {
            if *of + 1 == time || time % 3 == 0 {
                let found = all_results(together.hits(*done, *query).unwrap());
                assert!(found == *expected, "{of} at {time}, {query:?}");
            }
        }
    }
}

/// Tests pictures of the sky alone, pictures without pixels, and colours that are too few.
pub(crate) fn odd_pictures_do_not_panic(device: &Device) {
    let pose = CameraPose::new([0.0, 1.0, 4.0], [0.0; 3]).with_fov(50.0);
    let look = |size| Camera::look_at(pose, size);
    let camera = look([8, 6]).unwrap();
    let nowhere = [[f32::NAN; 3]; 3];
    let mesh = Mesh::fixed(&nowhere, &[[0, 1, 2]]).unwrap();
    let scenes = [[mesh.clone()], [floor()]].map(|meshes| scene_of(meshes).0);
    for scene in [Scene::new()].into_iter().chain(scenes) {
        let mut tracer = pool::tracer(scene, device);
        let rgba = picture(&mut tracer, &camera);
        assert!(rgba.len() == 8 * 6 * 4 && rgba.chunks(4).all(|pixel| pixel[3] == 255));
        let none = Camera { width: 0, ..camera };
        assert!(picture(&mut tracer, &none).is_empty());
    }
    let few = mesh.with_colours(&[]);
    assert!(matches!(few, Err(Error::Mesh(_))), "{few:?}");
}
