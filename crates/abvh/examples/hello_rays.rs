//! Traces rays to a waving sheet. Each step passes new positions of all vertices.

#![expect(clippy::print_stdout, reason = "it shows what it found")]

use abvh::{Error, Mesh, Query, Ray, Scene, Source, Tracer};

fn main() -> Result<(), Error> {
    let sheet =
        |time: f32| [0, 1, 2, 3].map(|i| [(i % 2) as f32, (time + i as f32).sin(), (i / 2) as f32]);
    let mut scene = Scene::new();
    let cloth = scene.add(Mesh::streamed(&sheet(0.0), &[[0, 1, 2], [2, 1, 3]])?);
    let mut tracer = Tracer::builder().build(scene)?;
    let rays = [0.2, 0.5, 0.8].map(|x| Ray::new([x, 9.0, 0.4], [0.0, -1.0, 0.0]));
    for time in 0..10 {
        let mut step = tracer.step(0.0);
        step.vertices(cloth, Source::Host(&sheet(time as f32)))?;
        let depth = step.trace(&rays, Query::Closest)?;
        let done = step.submit()?;
        let hits = tracer.hits(done, depth)?;
        println!("{:?}", hits.distances().collect::<Vec<_>>());
    }
    Ok(())
}

#[test]
fn main_succeeds() {
    main().unwrap();
}
