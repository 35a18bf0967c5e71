//! Rays, and answers to them, that lie in memory of a device's: what is asked of them whoever owns it.

use crate::scenes::{rays, swarm};
use abvh::{Mesh, Query, QueryId, Ray, Scene, Step, Tracer};

/// A tracer, rays, and room for answers to them.
pub(crate) trait LentRays {
    fn tracer(&mut self) -> &mut Tracer;
    /// What the rays find, with answers written to the room or without.
    fn ask(&mut self, query: Query, has_room: bool) -> Found;
    fn fill_room(&mut self, byte: u8);
    /// As many first words of the room.
    fn room(&mut self, words: usize) -> Vec<u32>;
}

/// `t`, `u`, `v` and triangle of each ray's hit as they are written to answers; zeros, where only any hit is sought.
pub(crate) type Found = Vec<Option<[u32; 4]>>;

/// What a query of a step finds.
pub(crate) fn found(
    tracer: &mut Tracer,
    query: Query,
    ask: impl FnOnce(&mut Step<'_>) -> abvh::Result<QueryId>,
) -> Found {
    let mut step = tracer.step(0.5);
    let asked = ask(&mut step).unwrap();
    let done = step.submit().unwrap();
    let hits = tracer.hits(done, asked).unwrap();
    let answer = |ray| match query {
        Query::Any => hits.is_hit(ray).then_some([0; 4]),
        _ => hits.closest(ray).map(|hit| {
            let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
            [t, u, v, hit.triangle]
        }),
    };
    (0..hits.len()).map(answer).collect()
}

/// Triangles that fly about.
pub(crate) fn scene() -> Scene {
    let swarm = swarm(300);
    let keys = (0..3).map(|key| swarm.key(key).unwrap().to_vec());
    let mut scene = Scene::new();
    scene.add(Mesh::keyframes(keys.collect::<Vec<_>>(), swarm.triangles()).unwrap());
    scene
}

/// In which no ray can hit anything.
fn nothing() -> Scene {
    let mut nothing = Scene::new();
    let nowhere = [[f32::NAN; 3]; 3];
    nothing.add(Mesh::fixed(&nowhere, &[[0, 1, 2]]).unwrap());
    nothing
}

/// Some of which can hit nothing, and some that start far away.
pub(crate) fn all_kinds() -> Vec<Ray> {
    let mut all = rays(1000);
    let spoil: [fn(&mut Ray); 12] = [
        |ray| ray.direction = [0.0, -0.0, 0.0],
        |ray| ray.direction[1] = f32::NAN,
        |ray| ray.direction[2] = f32::INFINITY,
        |ray| ray.origin[0] = f32::NAN,
        |ray| ray.origin[1] = f32::NEG_INFINITY,
        |ray| ray.t_min = f32::NAN,
        |ray| ray.t_max = -f32::NAN,
        |ray| (ray.t_min, ray.t_max) = (1.5, 0.5),
        |ray| (ray.t_min, ray.t_max) = (-0.0, 0.0),
        |ray| (ray.t_min, ray.t_max) = (f32::INFINITY, f32::NEG_INFINITY),
        // Valid, and seen by exact arithmetic alone.
        |ray| (ray.origin, ray.direction) = ([-1e30, 0.01, 0.02], [1.0, 0.0, 0.0]),
        |ray| (ray.origin, ray.direction) = ([0.1, 3e38, 0.0], [0.0, -1.0, 1e-30]),
    ];
    for (i, ray) in all.iter_mut().enumerate() {
        if i % 3 == 0 {
            spoil[i / 3 % spoil.len()](ray);
        }
    }
    all
}

/// They find and have written what rays of the host find; nor is what stood in the room taken for hits. Gives the last of them,
/// which sought closest hits among triangles.
pub(crate) fn find_what_the_hosts_do<L: LentRays>(open: impl Fn(Scene, &[Ray]) -> L) -> L {
    let list = all_kinds();
    let [_, last] = [(nothing(), false), (scene(), true)].map(|(scene, hits_some)| {
        let mut lent = open(scene, &list);
        for query in [Query::Any, Query::Closest] {
            let expected = found(lent.tracer(), query, |step| step.trace(&list, query));
            assert_eq!(expected.iter().flatten().count() > 100, hits_some);
            lent.fill_room(7);
            for has_room in [false, true] {
                let seen = lent.ask(query, has_room);
                assert!(seen == expected, "{query:?} {has_room}");
            }
            let miss = [f32::INFINITY.to_bits(), 0, 0, u32::MAX];
            if query == Query::Any {
                let met = lent.room(list.len()).into_iter().map(|word| word != 0);
                assert!(met.eq(expected.iter().map(Option::is_some)));
            } else {
                let words: Vec<_> = expected.iter().map(|hit| hit.unwrap_or(miss)).collect();
                assert!(lent.room(4 * list.len()) == words.as_flattened());
            }
        }
        lent
    });
    last
}
