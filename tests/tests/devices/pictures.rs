//! Pictures that a device shades are the host's, byte for byte.

use crate::Subject;
use crate::scenes::{apart, cameras, hits, look, open_laid, stand, swarm};
use backend::{Layout, Query, QueryKind, Rays};
use geom::{Animation, Camera, Point};
use integration::stage::colours;
use shading::Shot;
use std::sync::Arc;

/// Pixels of a picture.
const SIZE: [u32; 2] = [66, 62];

/// The device's picture of the scene as it stands at `time` has the bytes of the host's, and shows some of it.
fn check(
    backend: &mut dyn Subject,
    (animation, time): (&Animation, f64),
    camera: &Camera,
    light: Point,
) {
    let query = Query {
        rays: Rays::Camera(camera),
        kind: QueryKind::ClosestAndShadow { light },
    };
    stand(backend, animation, time);
    backend.trace(query).unwrap();
    backend.shade(query).unwrap();
    let ticket = backend.submit().unwrap();
    let mut pixels = Vec::new();
    assert!(backend.pixels(ticket, &mut pixels).unwrap());
    let found = hits(backend, ticket);
    let shot = Shot {
        moment: animation.at(time).unwrap(),
        colours: &colours(animation.triangle_count()),
        camera,
        light,
    };
    let mut expected = Vec::new();
    shading::shade(&shot, &found.closest, &found.blocked, &mut expected);
    assert!(pixels.chunks(4).all(|pixel| pixel[3] == 255));
    assert!(pixels == expected, "{camera:?} at {time} under {light:?}");
    assert!(found.closest.iter().any(|hit| hit.is_hit()), "{camera:?}");
}

/// The swarm at a size of its own.
fn scaled(by: f32) -> Arc<Animation> {
    let usual = swarm(300);
    let keys = usual.all_keys().unwrap();
    let keys = keys.iter();
    let scale = |p: &Point| p.map(|x| x * by);
    apart(keys.map(|key| key.iter().map(scale).collect()).collect())
}

/// A triangle before the eye, and others so far from it in size that no single scale serves all.
fn mixed() -> Arc<Animation> {
    let corners = |s: f32| [[-s, -s, -s], [s, -s, 0.5 * s], [0.1 * s, s, -s]];
    apart(vec![[1.0, 1e-30, 1e30, 1e-3].map(corners).concat()])
}

pub(crate) fn a_device_shades_as_the_host_does(backend: &mut dyn Subject) {
    let load = |animation: &Arc<Animation>, backend: &mut dyn Subject| {
        open_laid(backend, animation, Layout::Fast);
        let palette = shading::palette(&colours(animation.triangle_count()));
        assert!(backend.load_palette(&palette).unwrap());
    };
    let lamp = [2.0, 5.0, 3.0];
    let usual = swarm(2000);
    load(&usual, backend);
    for camera in cameras(SIZE) {
        for (time, light) in [(0.0, lamp), (0.7, [0.1, 0.2, 0.3]), (1.0, [0.0; 3])] {
            check(backend, (&usual, time), &camera, light);
        }
    }
    for by in [1e-36, 1e-12, 1e9, 1e30] {
        let animation = scaled(by);
        load(&animation, backend);
        let eye = [0.3 * by, 0.2 * by, 3.0 * by];
        let camera = look(eye, [0.0; 3], (50.0, SIZE));
        for light in [eye, [f32::MAX, 0.0, 1.0], [1e-40, -1e-38, 0.0]] {
            check(backend, (&animation, 0.3), &camera, light);
        }
    }
    let animation = mixed();
    load(&animation, backend);
    for distance in [3e-30, 3.0, 3e3, 3e30] {
        let camera = look([0.0, 0.1 * distance, distance], [0.0; 3], (60.0, SIZE));
        check(backend, (&animation, 0.0), &camera, lamp);
    }
}

pub(crate) fn nothing_is_shaded_without_a_palette(backend: &mut dyn Subject) {
    let (animation, camera) = (swarm(50), &cameras(SIZE)[0]);
    open_laid(backend, &animation, Layout::Bvh2);
    stand(backend, &animation, 0.0);
    let query = Query {
        rays: Rays::Camera(camera),
        kind: crate::scenes::SHADOWED,
    };
    backend.trace(query).unwrap();
    backend.shade(query).unwrap();
    let ticket = backend.submit().unwrap();
    assert!(!backend.pixels(ticket, &mut vec![1]).unwrap());
}
