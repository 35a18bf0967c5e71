use super::*;
use cpu_ref::CpuBackend;

fn ask(bodies: &[Body], rays: u64) -> LeakReport {
    let mut cpu = CpuBackend::new(Some(2)).unwrap();
    let plan = LeakPlan {
        seed: 5,
        rays,
        offsets: OFFSETS.to_vec(),
        method: Method::default(),
    };
    let mut heard = Vec::new();
    let found = run_over(&mut cpu, &plan, bodies, &mut |n| heard.push(n)).unwrap();
    assert_eq!(heard.last(), Some(&rays));
    assert_eq!(found.rows.iter().map(|r| r.rays).sum::<u64>(), rays);
    found
}

#[test]
fn a_body_without_one_triangle_leaks() {
    let torn = BODIES.iter().map(|&body| Body {
        shape: || {
            let (points, mut triangles) = (BODIES[0].shape)();
            triangles.pop();
            (points, triangles)
        },
        inner: BODIES[0].inner,
        radius: BODIES[0].radius,
        ..body
    });
    let torn: Vec<Body> = torn.take(1).collect();
    let found = ask(&torn, 60_000);
    // At a vertex, ties always fall to the same side, where there may be no hole.
    let aimed = |r: &&LeakRow| r.inside && r.aim != Aim::Vertex;
    for row in found.rows.iter().filter(aimed) {
        assert!(row.leaks > 0, "{row:?}");
    }
    for inside in [true, false] {
        let rows = found.rows.iter().filter(|r| r.inside == inside);
        assert!(rows.map(|r| r.miscounts).sum::<u64>() > 0);
    }
    assert_eq!(found.first.len(), KEPT);
    let text = &found.first[0];
    assert!(
        text.contains("icosphere") && text.contains("origin "),
        "{text}"
    );
}

#[test]
fn a_triangle_that_is_there_twice_is_a_double_hit() {
    let doubled = [Body {
        shape: || {
            let (points, mut triangles) = (BODIES[1].shape)();
            triangles.push(triangles[7]);
            (points, triangles)
        },
        ..BODIES[1]
    }];
    let found = ask(&doubled, 60_000);
    assert_eq!(found.rows.iter().map(|r| r.leaks).sum::<u64>(), 0);
    for inside in [true, false] {
        let rows = || found.rows.iter().filter(|r| r.inside == inside);
        assert!(rows().map(|r| r.miscounts).sum::<u64>() > 0);
        let doubled = rows().map(|r| r.doubled).sum::<u64>();
        assert_eq!(doubled > 0, inside);
    }
}

#[test]
fn rays_depend_on_seed_and_number_alone() {
    let place = (&BODIES[3], 10.0);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let first = batch(place, 160, 9).1;
    assert_eq!(first, one.unwrap().install(|| batch(place, 160, 9).1));
    assert_ne!(first, batch(place, 160, 10).1);
}
