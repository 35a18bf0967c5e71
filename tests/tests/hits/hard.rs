//! Rays that need more than the first kernel of `exact`: from far away, at ties, and at hits that its filter leaves
//! open (docs/design/exact-arithmetic.md).

use crate::exact::check;
use backend::{Backend, Hits, Intersector, Query};
use conformance::stage::open;
use conformance::{Target, aimed};
use geom::{Animation, Camera, CameraPose, Hit, Point, Ray};
use integration::stage::{camera, closest, host, light, separate_triangles, trace};
use std::f32::consts::TAU;
use std::sync::Arc;

fn demo(name: &str) -> Arc<Animation> {
    let scene = scene::open(name, &scene::SceneOptions::default());
    scene.unwrap().animation
}

fn still(points: Vec<Point>, triangles: Vec<[u32; 3]>) -> Arc<Animation> {
    Arc::new(Animation::new(vec![points], triangles).unwrap())
}

/// A fan of `triangles` triangles round one vertex. The other vertices are on a cylinder.
fn hub(triangles: u32) -> Arc<Animation> {
    let spoke = |i: u32| {
        let (y, x) = (i as f32 * TAU / triangles as f32).sin_cos();
        [x, y, 0.25 * (i % 3) as f32]
    };
    let mut points = vec![[0.0, 0.0, 0.5]];
    points.extend((0..triangles).map(spoke));
    let ring = (0..triangles).map(|i| [0, 1 + i, 1 + (i + 1) % triangles]);
    still(points, ring.collect())
}

/// Rays through the hub. Rays with a negative `t_min` need multi-word integers.
fn through_hub() -> Vec<Ray> {
    let from = |x: f32, y: f32, t_min: f32| Ray {
        t_min,
        ..Ray::new([x, y, 3.0], [-x, -y, -2.5])
    };
    let places = (0..12).map(|i| [0.5 * (i % 4) as f32 - 0.75, 0.5 * (i / 4) as f32 - 0.5]);
    let starts = [0.0, 0.5, 1.0, -1.0, f32::NEG_INFINITY];
    let all = places.flat_map(|[x, y]| starts.map(|t| from(x, y, t)));
    all.collect()
}

/// Groups of triangles, each met by one ray of [`at_tiny_offsets`]. The hit depends on coordinates so small that all
/// coordinates in a common unit need more than 60 bits.
fn tiny_offsets() -> Arc<Animation> {
    const TINY: f32 = 1e-20;
    let ulp = f32::EPSILON;
    let beside_edge = |x: f32| {
        [
            [x, 0.0, 1.0],
            [-2.0 * TINY, 1.0, 1.0],
            [4.0 * TINY, -3.0, 1.0],
        ]
    };
    let slanted = |tip_x: f32, b_z: f32| [[-1.0, -1.0, 1.0], [1.0, -1.0, b_z], [tip_x, 1.0, 1.0]];
    let far = slanted(-TINY, 1.0 + 16.0 * ulp);
    let near = slanted(0.0, 1.0 + ulp);
    let groups = [
        // The ray passes the common edge on the right.
        vec![beside_edge(-1.0), beside_edge(1.0)],
        // The exact `t` is just beyond the middle between two floats.
        vec![slanted(-TINY, 1.0 + 2.0 * ulp)],
        // The same for the weight of the second vertex.
        vec![slanted(-TINY, 1.0)],
        // The rounded `t` of both are equal. The second one is nearer.
        vec![slanted(-TINY, 1.0 + ulp), slanted(TINY, 1.0 + ulp)],
        // As before, but the nearer triangle fits 60 bits. It is the second one here, the first one in the next group.
        vec![slanted(-TINY, 1.0 + ulp), near],
        vec![near, slanted(-TINY, 1.0 + ulp)],
        // Near triangles that fit 60 bits, each followed by a farther one that does not.
        [near, far].repeat(6),
    ];
    let rows = groups.iter().zip(TINY_OFFSET_ROWS);
    let points = rows.flat_map(|(group, row)| {
        group
            .concat()
            .into_iter()
            .map(move |[x, y, z]| [x, y + row, z])
    });
    separate_triangles(vec![points.collect()])
}

/// The `y` of each group.
const TINY_OFFSET_ROWS: [f32; 7] = [0.0, 8.0, 16.0, 24.0, 32.0, 40.0, 48.0];

fn at_tiny_offsets() -> Vec<Ray> {
    let starts = TINY_OFFSET_ROWS.map(|y| [0.0, y, 0.0]);
    let mut rays = starts.map(|start| Ray::new(start, [0.0, 0.0, 1.0]));
    // The weight of the third group is then near the middle between two floats.
    rays[2].origin[0] = f32::EPSILON / 4.0;
    rays.into()
}

/// A stack of `triangles` triangles in one place.
fn stack(triangles: usize) -> Arc<Animation> {
    let points = vec![[0.0, 0.0, 1.0], [3.0, 0.0, 1.0], [0.0, 3.0, 1.0]];
    still(points, vec![[0, 1, 2]; triangles])
}

/// Numbers of triangles in a stack. All of them are candidates of one ray, as the exact `t` are equal. Before Mesa
/// 23.1, lavapipe ended the search (`TALL`) or the pass over the candidates (`LOWER`) early.
const TALL: usize = 30_000;
const LOWER: usize = 12_000;

/// One ray through the stack, and one that misses it.
fn down() -> Vec<Ray> {
    let down = |x: f32| Ray::new([x, 0.5, 4.0], [0.25, 0.125, -3.0]);
    vec![down(0.5), down(9.0)]
}

pub(crate) fn rays_match_the_oracle(backend: &mut dyn Backend) {
    // From these distances, every triangle is a candidate or rounded arithmetic decides nothing.
    let cloth = demo("demo:twist:1500");
    let far = [1e6, 1e22, 1e25].map(|far| aimed(&cloth, 0.0, Target::Vertex, far, 60));
    for (animation, rays) in [
        (cloth, far.concat()),
        (hub(500), through_hub()),
        (stack(TALL), down()),
        (stack(LOWER), down()),
        (sliver(), vec![AT_SLIVER]),
        (tiny_offsets(), at_tiny_offsets()),
    ] {
        check(backend, &animation, 0.0, &rays);
    }
}

pub(crate) fn watertight_finds_stacks_and_slivers(backend: &mut dyn Backend) {
    for (animation, rays, expected) in [
        (stack(TALL), down(), vec![0, Hit::MISS.triangle]),
        (sliver(), vec![AT_SLIVER], vec![0]),
    ] {
        open(backend, &animation, 0.0, Intersector::Watertight).unwrap();
        let hits = closest(backend, &animation, 0.0, &rays);
        assert!(hits.iter().map(|h| h.triangle).eq(expected), "{hits:?}");
    }
}

/// A triangle with edges of `3.3e-13` and `1.1e-16`. Without scaling, the numerator of `t` would be below `1e-40`, and
/// a device that flushes subnormal numbers would miss the triangle.
fn sliver() -> Arc<Animation> {
    let points = vec![
        [1.000_418e-9, 9.997_51e-10, 1.000_179_9e-9],
        [1.000_442_4e-9, 9.994_834e-10, 1.000_366e-9],
        [1.000_418e-9, 9.997_511e-10, 1.000_179_9e-9],
    ];
    still(points, vec![[0, 1, 2]])
}

const AT_SLIVER: Ray = Ray {
    origin: [9.970_69e-10, 9.984_1e-10, 9.994_48e-10],
    t_min: 0.0,
    direction: [3.348_987_8e-12, 1.340_927_4e-12, 7.319_700_4e-13],
    t_max: f32::INFINITY,
};

/// A picture with shadows. Kernels generate its rays.
struct Picture {
    animation: Arc<Animation>,
    time: f64,
    camera: Camera,
    light: Point,
    /// Returns whether the host's hits are varied enough to detect errors of a device.
    is_varied: fn(&Hits) -> bool,
}

/// Checks that the device's hits equal the host's, bit for bit.
pub(crate) fn pictures_match_the_host(backend: &mut dyn Backend) {
    let mut host = host();
    for picture in pictures() {
        let (animation, time) = (&picture.animation, picture.time);
        let query = Query::picture(&picture.camera, picture.light);
        let ask = |backend: &mut dyn Backend| {
            open(backend, animation, 0.0, Intersector::Exact).unwrap();
            trace(backend, animation, time, query)
        };
        let (expected, found) = (ask(&mut host), ask(backend));
        let is_varied = (picture.is_varied)(&expected);
        assert!(is_varied, "too few different hits: {:?}", picture.camera);
        let pixels = |hits: Hits| hits.closest.into_iter().zip(hits.blocked);
        let mut pairs = pixels(expected).zip(pixels(found)).enumerate();
        let other = pairs.find(|(_, (a, b))| a != b);
        assert!(other.is_none(), "{other:?} by {:?}", picture.camera);
    }
}

fn pictures() -> Vec<Picture> {
    let cloth = demo("demo:twist:1500");
    let far = |(distance, light): (f32, f32)| Picture {
        animation: Arc::clone(&cloth),
        time: 0.0,
        camera: camera_at(distance, &cloth),
        light: [0.3 * light, light, 0.2 * light],
        is_varied: |hits| hits.closest.iter().any(|h| h.is_hit()),
    };
    let mut all: Vec<_> = [(3.0, 1e6), (1e6, 3.0), (1e25, 1e7)].map(far).into();
    let doubled = twice(&demo("demo:collide:2000"));
    all.push(Picture {
        time: 0.4 * doubled.end(),
        // Single rays trace this picture: it has too many pixels for packets and rasterization on software drivers, and
        // too few on other drivers.
        camera: camera(&doubled, [170, 100]),
        light: light(&doubled),
        is_varied: |hits| {
            let count = hits.closest.iter().filter(|h| h.is_hit()).count();
            let blocked = hits.blocked.iter().filter(|&&b| b == 1).count();
            count >= 1000 && blocked >= 100 && blocked + 100 <= count
        },
        animation: doubled,
    });
    all.push(Picture {
        animation: ridges(),
        time: 0.0,
        camera: over_ridges(),
        light: [40.0, 0.3, 6.0],
        is_varied: |hits| {
            let on_crests = hits.closest.iter().zip(&hits.blocked).step_by(2);
            let met = on_crests.filter(|(h, _)| h.is_hit());
            let (dark, lit): (Vec<_>, Vec<_>) = met.partition(|(_, b)| **b == 1);
            dark.len() >= 60 && lit.len() >= 60
        },
    });
    // Twice the wall of `seam`: with rays exactly through its common edge, and with rays close to the edge, in a scene
    // that is scaled.
    all.extend(
        [(0.0, 1.0), (1e-8, 2_f32.powi(-20))].map(|(x, scale)| Picture {
            animation: seam(x, scale),
            time: 0.0,
            camera: at_seam(scale),
            light: [0.0, 3.0 * scale, scale],
            is_varied: |hits| {
                let column = hits.closest.iter().zip(&hits.blocked);
                let column: Vec<_> = column.skip(8).step_by(17).collect();
                let wall = column.iter().filter(|(h, _)| h.triangle < 2).count();
                let dark = column.iter().filter(|(h, b)| h.triangle == 2 && **b == 1);
                wall >= 3 && dark.count() >= 3
            },
        }),
    );
    all
}

/// A wall of two triangles above a floor. The rays of the middle column, and the shadow rays from their hits on the
/// floor, are at the distance `x * scale` from the common edge. One of its ends is so near to zero along z that the
/// triangles need more than 60 bits. If `x` is zero, a device needs multi-word integers, and leaves the hits on the
/// wall to its last kernel.
fn seam(x: f32, scale: f32) -> Arc<Animation> {
    let points = [
        [x, 0.25, 0.0],
        [x, 2.0, 1.234_5e-12],
        [-2.0, 0.25, 0.0],
        [2.0, 0.25, 0.0],
        [0.0, -0.5, -6.0],
        [-3.0, -0.5, 3.0],
        [3.0, -0.5, 3.0],
    ];
    let points = points.map(|point| point.map(|x| x * scale));
    still(points.into(), vec![[0, 1, 2], [1, 0, 3], [4, 5, 6]])
}

/// A camera whose middle column of 17 has rays with x = 0.
fn at_seam(scale: f32) -> Camera {
    Camera {
        eye: [0.0, 0.0, 2.0 * scale],
        width: 17,
        height: 16,
        corner: [-17.0 / 16.0, 0.2, -1.0],
        across: [0.125, 0.0, 0.0],
        down: [0.0, -0.025, 0.0],
    }
}

/// Creates a camera at `distance` along an axis, with the scene in the middle of the picture.
fn camera_at(distance: f32, animation: &Animation) -> Camera {
    let size = animation.bounds().extent().into_iter().fold(0.0, f32::max);
    let angle = (size / distance).min(1.0).to_degrees();
    let pose = CameraPose::new([0.0, distance, 0.0], [0.0; 3]).with_fov(angle);
    Camera::look_at(pose.with_up([0.0, 0.0, 1.0]), [16, 12]).expect("a picture")
}

/// Doubles every triangle, and adds every third one again with rotated vertices. So every hit is a tie. The first
/// kernel decides neither the hit nor its shadow.
fn twice(animation: &Animation) -> Arc<Animation> {
    let triangles = animation.triangles();
    let turned = triangles.iter().step_by(3).map(|&[a, b, c]| [b, c, a]);
    let all = triangles.iter().chain(triangles).copied().chain(turned);
    let keys = animation.all_keys().unwrap();
    let keys = keys.iter().map(|key| key.to_vec()).collect();
    Arc::new(Animation::new(keys, all.collect()).unwrap())
}

/// Number of ridges, and number of segments per ridge.
const RIDGES: i16 = 16;
const SEGMENTS: i16 = 40;
/// Rows of pixels. No row hits the end of a segment.
const ROWS: u32 = 12;

/// Ridges that are steep on the left and gentle on the right. In every other ridge the left slope comes first. Rays
/// along a crest have both slopes as candidates, and one slope is in shadow there.
fn ridges() -> Arc<Animation> {
    let (mut points, mut triangles) = (Vec::<Point>::new(), Vec::new());
    for ridge in 0..RIDGES {
        let crest = f32::from(2 * (ridge - RIDGES / 2));
        for segment in 0..SEGMENTS {
            let y = f32::from(segment - SEGMENTS / 2);
            let at = points.len() as u32;
            for (x, z) in [(crest - 0.25, -1.0), (crest, 0.0), (crest + 1.75, -1.0)] {
                points.extend([[x, y, z], [x, y + 1.0, z]]);
            }
            let slope = |v: u32| [[v, v + 2, v + 1], [v + 2, v + 3, v + 1]];
            let mut both = [slope(at), slope(at + 2)];
            if ridge % 2 == 1 {
                both.reverse();
            }
            triangles.extend(both.concat());
        }
    }
    // This triangle is coplanar with the eye and the first column of pixels, so their rays miss it.
    let at = points.len() as u32;
    points.extend([[-18.0, -8.0, 0.0], [-18.0, 8.0, 0.0], [-9.0, 0.0, 8.0]]);
    triangles.push([at, at + 1, at + 2]);
    still(points, triangles)
}

/// A camera above the ridges. There is one column of pixels per crest, one between each two, and three outside.
fn over_ridges() -> Camera {
    Camera {
        eye: [0.0, 0.0, 16.0],
        width: 2 * RIDGES as u32 + 2,
        corner: [f32::from(-RIDGES) - 2.5, ROWS as f32 / 2.0 + 0.75, -16.0],
        height: ROWS,
        across: [1.0, 0.0, 0.0],
        down: [0.0, -1.0, 0.0],
    }
}
