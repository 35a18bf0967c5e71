//! Cameras that are traced in one submission.

use crate::{bits, demo, of_keys};
use abvh::{Device, Hits, Query};

/// All that is told of a query's hits.
fn told(hits: Hits<'_>) -> (Vec<bool>, Vec<[u32; 4]>) {
    let met = (0..hits.len()).map(|ray| hits.is_hit(ray));
    (met.collect(), bits(hits))
}

/// Beside rays of a list, of which every step has another number; and results stay until the second step after.
pub(crate) fn together(device: &Device) {
    let demo = demo("demo:collide:3000");
    let [mut together, mut alone] = [0; 2].map(|_| of_keys(&demo, &demo.keys, device));
    let camera = |size| integration::stage::camera(&demo.animation, size);
    let sizes = [[40, 30], [1, 1], [64, 3], [40, 30], [17, 90]];
    let kinds = [Query::Closest, Query::Any];
    let all = |count: usize| (0..count).map(|i| (camera(sizes[i % 5]), kinds[i % 2]));
    let mut asked = Vec::new();
    for (time, count) in [3, 9, 1, 0, 17, 2, 9, 9].into_iter().enumerate() {
        let mut step = together.step(time as f64);
        let mut queries = Vec::new();
        for (i, (camera, kind)) in all(count).enumerate() {
            if i == 1 {
                step.trace(&demo.rays, Query::Closest).unwrap();
            }
            queries.push(step.trace(&camera, kind).unwrap());
        }
        let done = step.submit().unwrap();
        for (query, (camera, kind)) in queries.into_iter().zip(all(count)) {
            let mut step = alone.step(time as f64);
            let one = step.trace(&camera, kind).unwrap();
            let one_done = step.submit().unwrap();
            let expected = told(alone.hits(one_done, one).unwrap());
            asked.push((time, done, query, expected));
        }
        asked.retain(|(of, ..)| of + 1 >= time);
        // The one before first: nobody has looked at most of its results yet.
        for (of, done, query, expected) in &asked {
            if *of + 1 == time || time % 3 == 0 {
                let found = told(together.hits(*done, *query).unwrap());
                assert!(found == *expected, "{of} at {time}, {query:?}");
            }
        }
    }
}
