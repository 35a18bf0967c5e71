//! Simulates a cloth of springs that falls on a dome, streams its vertices in each step, and traces its depth from
//! above.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::{Camera, CameraPose, Error, Mesh, Point, Query, Scene, Source, Tracer};

/// Number of vertices along each side of the cloth and of the dome.
const SIDE: u32 = 33;
/// Distance from the dome's centre to which nearer vertices are moved, before the springs act. The dome's radius is 1,
/// and the cloth's triangles are nearer to the centre than their vertices.
const NEAREST: f32 = 1.05;

fn grid(place: impl Fn(f32, f32) -> Point) -> Vec<Point> {
    let along = |i: u32| 2.0 * i as f32 / (SIDE - 1) as f32 - 1.0;
    let vertex = |v: u32| place(along(v % SIDE), along(v / SIDE));
    (0..SIDE * SIDE).map(vertex).collect()
}

fn length(p: Point) -> f32 {
    p.iter().map(|x| x * x).sum::<f32>().sqrt()
}

/// Advances the simulation by 1/60 s, by Verlet integration with the squares' sides as constraints (Jakobsen 2001).
fn advance(cloth: &mut [Point], before: &mut [Point], triangles: &[[u32; 3]]) {
    for (now, before) in cloth.iter_mut().zip(before) {
        let fall = [0.0, -9.8 / 3600.0, 0.0];
        let next = [0, 1, 2].map(|i| 1.99 * now[i] - 0.99 * before[i] + fall[i]);
        let out = (NEAREST / length(next)).max(1.0);
        *before = *now;
        *now = next.map(|x| out * x);
    }
    let springs = triangles.iter().flat_map(|t| [[t[0], t[1]], [t[0], t[2]]]);
    for [a, b] in (0..10).flat_map(|_| springs.clone()) {
        let (a, b) = (a as usize, b as usize);
        let apart = [0, 1, 2].map(|i| cloth[b][i] - cloth[a][i]);
        let share = 0.5 - 0.5 * 3.0 / (SIDE - 1) as f32 / length(apart);
        for i in 0..3 {
            cloth[a][i] += share * apart[i];
            cloth[b][i] -= share * apart[i];
        }
    }
}

fn main() -> Result<(), Error> {
    let squares = (0..SIDE * (SIDE - 1)).filter(|a| a % SIDE + 1 < SIDE);
    let halves = |a| [[a, a + 1, a + SIDE], [a + SIDE + 1, a + SIDE, a + 1]];
    let triangles: Vec<[u32; 3]> = squares.flat_map(halves).collect();
    let pyramid = grid(|x, z| [x, 1.0 - x.abs().max(z.abs()), z]);
    let dome: Vec<Point> = pyramid.iter().map(|&p| p.map(|x| x / length(p))).collect();
    let mut cloth = grid(|x, z| [1.5 * x, 1.2, 1.5 * z]);
    let mut before = cloth.clone();
    let mut scene = Scene::new();
    scene.add(Mesh::fixed(&dome, &triangles)?);
    let sheet = scene.add(Mesh::streamed(&cloth, &triangles)?);
    let mut tracer = Tracer::builder().build(scene)?;
    let (eye, up) = ([0.0, 5.0, 0.0], [0.0, 0.0, -1.0]);
    let camera = Camera::look_at(CameraPose::new(eye, [0.0; 3]).with_up(up), [32, 32])
        .expect("it looks down");
    for frame in 1..=60 {
        advance(&mut cloth, &mut before, &triangles);
        let mut step = tracer.step(0.0);
        step.vertices(sheet, Source::Host(&cloth))?;
        let depth = step.trace(&camera, Query::Closest)?;
        let done = step.submit()?;
        let hits = tracer.hits(done, depth)?;
        let mut seen = (0..hits.len()).filter_map(|pixel| hits.closest(pixel));
        assert!(seen.all(|hit| hit.mesh == sheet), "the dome is covered");
        let top = 5.0 - hits.distances().fold(f32::INFINITY, f32::min);
        if frame % 10 == 0 {
            println!("frame {frame}: the highest point is at {top:.3}");
        }
        assert!(frame < 60 || (top - NEAREST).abs() < 0.02, "it lies on top");
    }
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
