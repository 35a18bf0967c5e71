//! Picks the mesh under the cursor in a moving scene. One ray per step returns the mesh, the triangle and the point.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::{Camera, CameraPose, Error, Matrix, Mesh, Point, Query, Scene, Tracer};

/// Returns the corners of an upright rectangle.
fn panel(x: [f32; 2], y: [f32; 2], z: f32) -> Vec<Point> {
    let corners = [[0, 0], [1, 0], [0, 1], [1, 1]];
    corners.map(|[i, j]| [x[i], y[j], z]).to_vec()
}

/// Returns the matrix that opens a door by an angle in radians, about its hinge at `x = -1, z = 0`.
fn open(angle: f32) -> Matrix {
    let (sin, cos) = angle.sin_cos();
    [
        [cos, 0.0, sin, cos - 1.0],
        [0.0, 1.0, 0.0, 0.0],
        [-sin, 0.0, cos, -sin],
    ]
}

fn main() -> Result<(), Error> {
    let triangles = [[0, 1, 2], [2, 1, 3]];
    let wall = panel([-5.0, 5.0], [-5.0, 5.0], -2.0);
    let door = panel([-1.0, 1.0], [0.0, 2.0], 0.0);
    let lift = [-2.0, 0.0].map(|y| panel([-1.0, 1.0], [y, y + 2.0], -1.0));
    let names = ["wall", "lift", "door"];
    let mut scene = Scene::new();
    scene.add(Mesh::fixed(&wall, &triangles)?);
    scene.add(Mesh::keyframes(lift.to_vec(), &triangles)?);
    let door = scene.add(Mesh::rigid(&door, &triangles, &[0; 4])?);
    let mut tracer = Tracer::builder().build(scene)?;

    let (eye, target) = ([0.0, 1.0, 5.0], [0.0, 1.0, 0.0]);
    let camera = Camera::look_at(CameraPose::new(eye, target), [640, 480]);
    let [x, y] = [400, 200];
    let ray = camera.expect("the eye is not at its target").ray(x, y);
    for (i, under) in ["door", "door", "wall", "lift", "lift"].iter().enumerate() {
        let time = i as f64 / 4.0;
        let mut step = tracer.step(time);
        step.poses(door, &[open(1.5 * time as f32)])?;
        let pick = step.trace(&[ray], Query::Closest)?;
        let done = step.submit()?;
        let hits = tracer.hits(done, pick)?;
        let hit = hits.closest(0).expect("the wall is behind everything");
        let name = names[hit.mesh.index()];
        let [x, y, z] = [0, 1, 2].map(|i| ray.origin[i] + hit.t * ray.direction[i]);
        let triangle = hit.triangle;
        println!("time {time}: triangle {triangle} of the {name} at ({x:.3}, {y:.3}, {z:.3})");
        assert_eq!(name, *under);
        let expected = match name {
            "wall" => -2.0,
            "lift" => -1.0,
            _ => -(x + 1.0) * (1.5 * time as f32).tan(),
        };
        assert!((z - expected).abs() < 1e-4, "the point lies on the {name}");
    }
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
