//! Traces four cameras around a mesh with key frames in one step, and prints the hit in the centre of each.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::{Camera, CameraPose, Error, Mesh, Query, Scene, Tracer};

fn main() -> Result<(), Error> {
    let square = |r: f32| [[-r, -r], [r, -r], [r, r], [-r, r]].map(|[x, z]| [x, 0.0, z]);
    // A pyramid that stretches.
    let pyramid = |height: f32| [&square(1.0)[..], &[[0.0, height, 0.0]]].concat();
    let sides = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let mut scene = Scene::new();
    let figure = scene.add(Mesh::keyframes(vec![pyramid(1.0), pyramid(2.0)], &sides)?);
    scene.add(Mesh::fixed(&square(9.0), &[[0, 1, 2], [0, 2, 3]])?);
    let mut tracer = Tracer::builder().build(scene)?;

    let size = [64, 48];
    let target = [0.0, 0.5, 0.0];
    let cameras = [[5.0, 0.3], [0.3, 5.0], [-5.0, 0.3], [0.3, -5.0]]
        .map(|[x, z]| Camera::look_at(CameraPose::new([x, 3.0, z], target), size));
    for time in [0.0, 0.5, 1.0] {
        let mut step = tracer.step(time);
        let mut views = Vec::new();
        for camera in cameras.iter().flatten() {
            views.push(step.trace(camera, Query::Closest)?);
        }
        let done = step.submit()?;
        for (i, view) in views.into_iter().enumerate() {
            let middle = (size[1] / 2 * size[0] + size[0] / 2) as usize;
            let hits = tracer.hits(done, view)?;
            if let Some(hit) = hits.closest(middle).filter(|hit| hit.mesh == figure) {
                let (side, t) = (hit.triangle, hit.t);
                println!("time {time}: camera {i} sees side {side} at {t:.3}");
            }
        }
    }
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
