//! Renders a waving sheet over a floor to `picture.png` in the folder for temporary files.

#![expect(clippy::print_stdout, reason = "it says where the picture is")]

use abvh::{Camera, CameraPose, Mesh, Point, Scene, Source, Tracer};
use std::error::Error;

/// Number of vertices along each side of the sheet.
const SIDE: u32 = 60;
const SIZE: [u32; 2] = [640, 360];

fn sheet(time: f32) -> Vec<Point> {
    let along = |i: u32| 4.0 * i as f32 / (SIDE - 1) as f32 - 2.0;
    let vertex = |v: u32| {
        let [x, z] = [along(v % SIDE), along(v / SIDE)];
        let height = 1.0 + 0.25 * (3.0 * (x * x + z * z).sqrt() - time).sin();
        [x, height, z]
    };
    (0..SIDE * SIDE).map(vertex).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let squares = (0..SIDE * (SIDE - 1)).filter(|a| a % SIDE + 1 < SIDE);
    let halves = |a| [[a, a + 1, a + SIDE], [a + SIDE + 1, a + SIDE, a + 1]];
    let triangles: Vec<[u32; 3]> = squares.flat_map(halves).collect();
    let floor = [[-9.0, 0.0, -9.0], [9.0, 0.0, -9.0], [0.0, 0.0, 9.0]];
    let mut scene = Scene::new();
    scene.add(Mesh::fixed(&floor, &[[0, 1, 2]])?.with_colours(&[[120, 130, 110]])?);
    let waves = Mesh::streamed(&sheet(0.0), &triangles)?;
    let waves = scene.add(waves.with_colours(&[[200, 70, 50]])?);
    let mut tracer = Tracer::builder().build(scene)?;

    let pose = CameraPose::new([3.5, 3.0, 4.5], [0.0, 0.7, 0.0]);
    let camera = Camera::look_at(pose, SIZE).ok_or("no camera")?;
    let mut step = tracer.step(0.0);
    step.vertices(waves, Source::Host(&sheet(1.0)))?;
    let picture = step.render(&camera, [3.0, 7.0, -1.0])?;
    let done = step.submit()?;
    let mut rgba = Vec::new();
    tracer.pixels(done, picture, &mut rgba)?;

    let file = std::env::temp_dir().join("picture.png");
    image::save_buffer(&file, &rgba, SIZE[0], SIZE[1], image::ColorType::Rgba8)?;
    println!("{}, rendered on {}", file.display(), tracer.device());
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
