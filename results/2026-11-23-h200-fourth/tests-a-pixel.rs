//! How many tests, stamps and large triangles rasters would have of a scene in 1920x1200, in double precision on the host.
//!
//! A package beside the crates it names (`geom`, `scene`, `picture`, by path) and `rayon`:
//! `cargo run --release -- SCENE [TIME [EYE LOOK-AT FOV]]`, by default nine times across the motion and the framed camera.

use geom::{Animation, Camera, Pose};
use rayon::prelude::*;

const SIZE: [u32; 2] = [1920, 1200];
const PIXELS: u64 = SIZE[0] as u64 * SIZE[1] as u64;

type V3 = [f64; 3];

fn cross(a: V3, b: V3) -> V3 {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Where a camera sees points: column times depth, row times depth, depth.
struct Picture {
    eye: V3,
    rows: [V3; 3],
}

impl Picture {
    fn of(camera: &Camera) -> Self {
        let [across, down, corner] = [camera.across, camera.down, camera.corner].map(|p| p.map(f64::from));
        let volume = dot(across, cross(down, corner));
        let rows = [cross(down, corner), cross(corner, across), cross(across, down)];
        Self { eye: camera.eye.map(f64::from), rows: rows.map(|r| r.map(|x| x / volume)) }
    }

    fn see(&self, point: [f32; 3]) -> V3 {
        let from_eye = [0, 1, 2].map(|i| f64::from(point[i]) - self.eye[i]);
        self.rows.map(|row| dot(row, from_eye))
    }
}

#[derive(Clone, Copy, Default)]
struct Sum {
    tests: u64,
    stamps: u64,
    large: u64,
}

impl Sum {
    fn add(self, other: Self) -> Self {
        Self {
            tests: self.tests + other.tests,
            stamps: self.stamps + other.stamps,
            large: self.large + other.large,
        }
    }
}

fn is_beside(seen: &[V3; 3]) -> bool {
    (0..2).any(|i| {
        let size = f64::from(SIZE[i]);
        seen.iter().all(|p| p[i] < 0.0) || seen.iter().all(|p| p[i] > size * p[2])
    })
}

fn of_triangle(seen: [V3; 3]) -> Sum {
    if seen.iter().all(|p| p[2] < 0.0) {
        return Sum::default();
    }
    if seen.iter().any(|p| p[2] <= 0.0) {
        let all = Sum { tests: PIXELS, stamps: PIXELS / 32, large: 1 };
        return if is_beside(&seen) { Sum::default() } else { all };
    }
    let at = seen.map(|p| [p[0] / p[2] - 0.5, p[1] / p[2] - 0.5]);
    let least = |i: usize| at.iter().map(|p| p[i]).fold(f64::MAX, f64::min);
    let most = |i: usize| at.iter().map(|p| p[i]).fold(f64::MIN, f64::max);
    let first = [0, 1].map(|i| (least(i) - 0.01).ceil().clamp(0.0, f64::from(SIZE[i])) as i64);
    let last = [0, 1].map(|i| (most(i) + 0.01).floor().clamp(-1.0, f64::from(SIZE[i]) - 1.0) as i64);
    if first[0] > last[0] || first[1] > last[1] {
        return Sum::default();
    }
    let blocks = ((last[0] - first[0] + 8) / 8) * ((last[1] - first[1] + 4) / 4);
    let tests = pixels_within(&at, first, last);
    let is_large = blocks > 32;
    Sum { tests, stamps: if is_large { tests.div_ceil(8) } else { blocks as u64 }, large: u64::from(is_large) }
}

fn pixels_within(at: &[[f64; 2]; 3], first: [i64; 2], last: [i64; 2]) -> u64 {
    let along = |i: usize| [0, 1].map(|k| at[(i + 1) % 3][k] - at[i][k]);
    let side = |i: usize, p: [f64; 2]| along(i)[0] * (p[1] - at[i][1]) - along(i)[1] * (p[0] - at[i][0]);
    let turn = side(0, at[2]).signum();
    let is_within = |p: [f64; 2]| (0..3).all(|i| side(i, p) * turn > -0.01 * (along(i)[0].abs() + along(i)[1].abs()));
    let rows = first[1]..=last[1];
    rows.map(|y| (first[0]..=last[0]).filter(|&x| is_within([x as f64, y as f64])).count() as u64).sum()
}

fn of_scene(animation: &Animation, pose: Pose, picture: &Picture) -> Sum {
    let triangles = (0..animation.triangle_count() as u32).into_par_iter();
    triangles
        .map(|t| of_triangle(animation.corners(pose, t).map(|p| picture.see(p))))
        .reduce(Sum::default, Sum::add)
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let scene = scene::open(&args[1], &scene::Options::default()).expect("a scene");
    let animation = &scene.animation;
    let mut view = picture::frame_scene(animation, 40.0, SIZE);
    if let [eye, look_at, fov] = &args[3.min(args.len())..] {
        let point = |text: &str| -> [f32; 3] {
            let all: Vec<f32> = text.split(',').map(|x| x.parse().expect("a number")).collect();
            all.try_into().expect("three numbers")
        };
        (view.eye, view.look_at, view.fov_degrees) = (point(eye), point(look_at), fov.parse().expect("degrees"));
    }
    let picture = Picture::of(&view.camera(SIZE).expect("a camera"));
    let times = match args.get(2) {
        Some(time) => vec![time.parse().expect("a time")],
        None => (0..9).map(|k| animation.end() * f64::from(k) / 8.0).collect(),
    };
    for time in times {
        let Sum { tests, stamps, large } = of_scene(animation, animation.pose(time), &picture);
        let room = animation.triangle_count() as u64 + PIXELS / 4;
        let each = tests as f64 / PIXELS as f64;
        println!("{} at {time:.2}: {each:.2} tests a pixel, {stamps} stamps (room for {room}), {large} large", args[1]);
    }
}
