//! A lidar sensor above a moving ground: 16 beams, one full turn per step, distances in metres.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::{Error, Mesh, Point, Query, Ray, Scene, Source, Tracer};
use std::f32::consts::TAU;

/// Number of squares along each side of the ground.
const SIDE: u32 = 64;
const BEAMS: usize = 16;
/// Number of horizontal directions per turn.
const COLUMNS: usize = 512;

/// Returns the vertices of a wave pattern at `time`, over 40 by 40 metres.
fn ground(time: f32) -> Vec<Point> {
    let vertex = |i: u32| {
        let place = [i % (SIDE + 1), i / (SIDE + 1)];
        let [x, z] = place.map(|j| 40.0 * (j as f32 / SIDE as f32 - 0.5));
        let height = 0.5 * (0.4 * x + time).sin() + 0.5 * (0.3 * z - time).cos();
        [x, height, z]
    };
    (0..(SIDE + 1) * (SIDE + 1)).map(vertex).collect()
}

fn triangles() -> Vec<[u32; 3]> {
    let square = |i: u32| {
        let a = i / SIDE * (SIDE + 1) + i % SIDE;
        let (b, c, d) = (a + 1, a + SIDE + 1, a + SIDE + 2);
        [[a, b, c], [c, b, d]]
    };
    (0..SIDE * SIDE).flat_map(square).collect()
}

/// Returns the rays of all beams over one turn, from a height of 3 metres. Ray directions have length 1, so that `t` is
/// a distance.
fn rays() -> Vec<Ray> {
    let ray = |i: usize| {
        let turn = (i / BEAMS) as f32 / COLUMNS as f32 * TAU;
        let (sin, cos) = (0.1 + 0.05 * (i % BEAMS) as f32).sin_cos();
        let direction = [turn.cos() * cos, -sin, turn.sin() * cos];
        Ray {
            t_max: 120.0,
            ..Ray::new([0.0, 3.0, 0.0], direction)
        }
    };
    (0..BEAMS * COLUMNS).map(ray).collect()
}

fn main() -> Result<(), Error> {
    let mut scene = Scene::new();
    let waves = scene.add(Mesh::streamed(&ground(0.0), &triangles())?);
    let mut tracer = Tracer::builder().build(scene)?;
    let rays = rays();
    for i in 0..5 {
        let mut step = tracer.step(0.0);
        step.vertices(waves, Source::Host(&ground(0.2 * i as f32)))?;
        let scan = step.trace(&rays, Query::Closest)?;
        let done = step.submit()?;
        let hits = tracer.hits(done, scan)?;
        let met: Vec<f32> = hits.distances().filter(|t| t.is_finite()).collect();
        let mean = met.iter().sum::<f32>() / met.len() as f32;
        let (met, all) = (met.len(), rays.len());
        println!("scan {i}: {met} of {all} rays came back, mean distance {mean:.2} m");
    }
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
