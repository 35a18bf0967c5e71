//! Pictures of steps.

use crate::{Demo, demo, pool};
use abvh::{Camera, Device, Error, Intersector, Mesh, Point, Query, Scene, Source, Tracer};
use backend::{QueryKind, Rays};
use geom::Animation;
use integration::stage::{Stage, camera, colours};
use shading::Shot;
use std::sync::Arc;

const FLOOR: [Point; 3] = [[-5.0, -0.6, -5.0], [5.0, -0.6, -5.0], [0.0, -0.6, 5.0]];
const FLOOR_COLOUR: [u8; 3] = [200, 20, 90];
pub(crate) const LAMP: Point = [2.0, 4.0, 1.5];

/// A floor of one colour under a mesh of many.
fn expected(cloth: &Demo, vertices: &[Point], camera: &Camera) -> Vec<u8> {
    let all = [&FLOOR, vertices].concat();
    let triangles = cloth.triangles.iter().map(|t| t.map(|v| v + 3));
    let triangles = std::iter::once([0, 1, 2]).chain(triangles).collect();
    let animation = Arc::new(Animation::new(vec![all], triangles).unwrap());
    let mut stage = Stage::new(&animation, Intersector::Watertight, 1);
    stage.plant(0.0);
    let kind = QueryKind::ClosestAndShadow { light: LAMP };
    let hits = stage.trace(0.0, Rays::Camera(camera), kind);
    let own = colours(cloth.triangles.len());
    let shot = Shot {
        moment: animation.at(0.0).unwrap(),
        colours: &[&[FLOOR_COLOUR][..], &own].concat(),
        camera,
        light: LAMP,
    };
    let mut rgba = Vec::new();
    shading::shade(&shot, &hits.closest, &hits.blocked, &mut rgba);
    assert!(hits.blocked.contains(&1) && hits.blocked.contains(&0));
    rgba
}

fn floor() -> Mesh {
    let floor = Mesh::fixed(&FLOOR, &[[0, 1, 2]]).unwrap();
    floor.with_colours(&[FLOOR_COLOUR]).unwrap()
}

/// However meshes move, beside other queries, and until the second step after.
pub(crate) fn shaded(device: &Device) {
    let demo = demo("demo:twist:2000");
    let own = colours(demo.triangles.len());
    let sizes = [[40, 30], [33, 20], [64, 50]];
    let cameras = sizes.map(|size| camera(&demo.animation, size));
    let live = Mesh::streamed(&demo.keys[0], &demo.triangles).unwrap();
    let keyed = Mesh::keyframes(demo.keys.clone(), &demo.triangles).unwrap();
    for (mesh, is_live) in [(live, true), (keyed, false)] {
        let mut scene = Scene::new();
        scene.add(floor());
        let id = scene.add(mesh.with_colours(&own).unwrap());
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

/// Colours stay with a mesh when others are replaced, and a new one brings its own.
pub(crate) fn replaced(device: &Device) {
    let demo = demo("demo:twist:300");
    let own = colours(demo.triangles.len());
    let mesh = Mesh::fixed(&demo.keys[1], &demo.triangles).unwrap();
    let mut scene = Scene::new();
    scene.add(floor());
    let id = scene.add(Mesh::fixed(&FLOOR, &[]).unwrap());
    let mut tracer = pool::tracer(scene, device);
    let camera = camera(&demo.animation, [40, 30]);
    let before = picture(&mut tracer, &camera);
    let replacement = tracer.replace(id, mesh.with_colours(&own).unwrap());
    tracer.commit(replacement.unwrap()).unwrap();
    let after = picture(&mut tracer, &camera);
    assert!(after == expected(&demo, &demo.keys[1], &camera));
    assert!(before != after);
}

fn picture(tracer: &mut Tracer, camera: &Camera) -> Vec<u8> {
    shown(tracer, 0.0, camera).0
}

/// The picture of a step, and the triangles that are hit in it.
pub(crate) fn shown(tracer: &mut Tracer, time: f64, camera: &Camera) -> (Vec<u8>, Vec<u32>) {
    let mut step = tracer.step(time);
    let picture = step.render(camera, LAMP).unwrap();
    let done = step.submit().unwrap();
    let mut rgba = Vec::new();
    tracer.pixels(done, picture, &mut rgba).unwrap();
    let hits = tracer.hits(done, picture).unwrap();
    let hit = hits.in_scene().iter().map(|hit| hit.triangle);
    (rgba, hit.collect())
}

/// Sky alone, no pixel at all, and colours that are too few.
pub(crate) fn odd(device: &Device) {
    let look = |size| Camera::look_at([0.0, 1.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 50.0, size);
    let camera = look([8, 6]).unwrap();
    let nowhere = [[f32::NAN; 3]; 3];
    let mesh = Mesh::fixed(&nowhere, &[[0, 1, 2]]).unwrap();
    for meshes in [vec![], vec![mesh.clone()], vec![floor()]] {
        let mut scene = Scene::new();
        for mesh in meshes {
            scene.add(mesh);
        }
        let mut tracer = pool::tracer(scene, device);
        let rgba = picture(&mut tracer, &camera);
        assert!(rgba.len() == 8 * 6 * 4 && rgba.chunks(4).all(|pixel| pixel[3] == 255));
        let none = Camera { width: 0, ..camera };
        assert!(picture(&mut tracer, &none).is_empty());
    }
    let few = mesh.with_colours(&[]);
    assert!(matches!(few, Err(Error::Mesh(_))), "{few:?}");
}
