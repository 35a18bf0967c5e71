//! Moves an arm of two rigid parts by matrices, and detects its hand with a ray.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::{Error, Matrix, Mesh, Point, Query, Ray, Scene, Tracer};

/// Returns the corners of a bar along the x axis.
fn bar(from: f32, to: f32) -> [Point; 4] {
    [[from, -0.1], [to, -0.1], [from, 0.1], [to, 0.1]].map(|[x, y]| [x, y, 0.0])
}

/// Returns a rotation by `angle` radians about the line through `[at, 0, 0]` that is parallel to the z axis.
fn turn(angle: f32, at: f32) -> Matrix {
    let (sin, cos) = angle.sin_cos();
    [
        [cos, -sin, 0.0, at - cos * at],
        [sin, cos, 0.0, -sin * at],
        [0.0, 0.0, 1.0, 0.0],
    ]
}

fn main() -> Result<(), Error> {
    let rest = [bar(0.0, 1.0), bar(1.0, 2.0)].concat();
    let triangles = [[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]];
    let mut scene = Scene::new();
    let arm = scene.add(Mesh::rigid(&rest, &triangles, &[0, 0, 0, 0, 1, 1, 1, 1])?);
    let mut tracer = Tracer::builder().build(scene)?;
    let watch = [Ray::new([1.9, 0.0, 5.0], [0.0, 0.0, -1.0])];
    for i in 0..8 {
        let mut step = tracer.step(0.0);
        step.poses(arm, &[turn(0.0, 0.0), turn(0.02 * i as f32, 1.0)])?;
        let hand = step.trace(&watch, Query::Any)?;
        let done = step.submit()?;
        let is_there = tracer.hits(done, hand)?.is_hit(0);
        println!("step {i}: the hand is there: {is_there}");
    }
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
