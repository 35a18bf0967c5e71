//! Tests how long results are available, and that they can be held and polled.

use crate::pool::{self, Pooled};
use crate::{Found, bits, demo, scene_of, tracer};
use abvh::{
    Device, Error, Hits, Mesh, MeshId, Query, QueryId, Ray, SceneHit, Source, StepId, Tracer,
    Update,
};
use integration::is_full;
use integration::stage::vast_camera;
use std::thread;
use std::time::{Duration, Instant};

type Asked = (StepId, QueryId);

/// A streamed mesh that each step moves.
struct Moving {
    keys: Vec<Vec<abvh::Point>>,
    rays: Vec<Ray>,
    tracer: Pooled,
    mesh: MeshId,
}

impl Moving {
    fn new(device: &Device, update: Update) -> Self {
        let demo = demo("demo:twist:2000");
        let stride = if is_full() { 1 } else { 4 };
        let mesh = Mesh::streamed(&demo.keys[0], &demo.triangles).unwrap();
        let (scene, [mesh]) = scene_of([mesh]);
        Self {
            tracer: pool::build(Tracer::builder().update(update), scene, device),
            keys: demo.keys,
            rays: demo.rays.into_iter().step_by(stride).collect(),
            mesh,
        }
    }

    /// Submits a step with a closest-hit and an any-hit query.
    fn submit(&mut self, i: usize) -> [Asked; 2] {
        let mut step = self.tracer.step(0.0);
        let vertices = &self.keys[i % self.keys.len()];
        step.vertices(self.mesh, Source::Host(vertices)).unwrap();
        let kinds = [Query::Closest, Query::Any];
        let queries = kinds.map(|kind| step.trace(&self.rays, kind).unwrap());
        let done = step.submit().unwrap();
        queries.map(|query| (done, query))
    }

    /// Drops a step after a trace. Returns the next step's id with the dropped query's id.
    fn drop_step(&mut self) -> Asked {
        let mut step = self.tracer.step(0.0);
        let query = step.trace(&self.rays, Query::Closest).unwrap();
        drop(step);
        // The dropped step has no id, so the next submitted one is used.
        let (done, other) = self.submit(0)[0];
        assert_ne!(query, other);
        (done, query)
    }

    fn hits(&self, (done, query): Asked) -> Result<Hits, Error> {
        self.tracer.hits(done, query)
    }

    /// Returns the closest hits of a step's first query, and the number of rays that hit in its second query.
    fn read(&self, asked: [Asked; 2]) -> (Found, usize) {
        let [closest, any] = asked.map(|asked| self.hits(asked).unwrap());
        let met = any.any().iter().map(|&met| usize::from(met)).sum();
        (bits(closest), met)
    }

    /// Submits a query that is refused, because no device has memory for its results.
    fn refuse(&mut self, i: usize) {
        let mut step = self.tracer.step(0.0);
        let vertices = &self.keys[i % self.keys.len()];
        step.vertices(self.mesh, Source::Host(vertices)).unwrap();
        let traced = step.trace(&vast_camera(), Query::Closest);
        let refused = traced.and_then(|_| step.submit());
        let is_refused = matches!(refused, Err(Error::Unsupported(_) | Error::OutOfMemory(_)));
        assert!(is_refused, "{refused:?}");
    }
}

pub(crate) fn held_results_survive_later_steps(device: &Device) {
    let mut live = Moving::new(device, Update::Async);
    let first = live.submit(0);
    let [closest, any] = first.map(|asked| live.hits(asked).unwrap());
    let (met, again) = live.read(first);
    let expected = bits(closest.clone());
    assert!(met == expected && again > 100 && closest.len() == live.rays.len());
    assert_eq!(closest.any().len() + any.in_scene().len(), 0);
    for i in 1..12 {
        // The results are read while the next step is prepared, after their memory could have been reused.
        let step = live.tracer.step(0.0);
        assert!(bits(closest.clone()) == expected, "{i}");
        drop(step);
        let asked = live.submit(i);
        assert!(live.read(asked).0 != expected, "{i}");
    }
    assert_eq!(live.hits(first[0]).err(), Some(Error::NoResult));
    let met = any.any().iter().filter(|&&met| met == 1).count();
    assert_eq!(met, again);
    let mut all = vec![SceneHit::MISS; closest.len() + 1];
    assert_eq!(closest.copy_to(&mut all), closest.len());
    assert!(all[..closest.len()] == *closest.in_scene() && !all[closest.len()].is_hit());
    let mut some = vec![SceneHit::MISS; 7];
    assert_eq!((closest.copy_to(&mut some), any.copy_to(&mut some)), (7, 0));
    assert!(some == closest.in_scene()[..7]);
    drop(live);
    let elsewhere = thread::spawn(move || bits(closest));
    assert!(elsewhere.join().unwrap() == expected);
}

pub(crate) fn dropped_steps_have_no_effect(device: &Device) {
    let mut live = Moving::new(device, Update::Async);
    let asked = live.submit(3);
    let expected = live.read(asked);
    for reads_second_first in [false, true] {
        let first = live.submit(3);
        for i in 0..40 {
            drop(live.tracer.step(0.0));
            let mut step = live.tracer.step(0.0);
            let query = step.trace(&live.rays[i..], Query::Closest).unwrap();
            drop(step);
            let dropped = live.tracer.hits(first[0].0, query).err();
            assert_eq!(dropped, Some(Error::NoResult));
            live.refuse(i);
        }
        let second = live.submit(3);
        if reads_second_first {
            assert!(live.read(second) == expected);
        }
        assert!(live.read(first) == expected, "{reads_second_first}");
        let (done, query) = live.drop_step();
        for step in [first[0].0, second[0].0, done] {
            assert_eq!(live.hits((step, query)).err(), Some(Error::NoResult));
        }
        assert_eq!(live.hits(first[0]).err(), Some(Error::NoResult));
        assert!(live.read(second) == expected, "{reads_second_first}");
    }
}

/// Checks that due trees are adopted after a refused query, and that no later result is lost or repeated.
pub(crate) fn refused_queries_change_nothing(device: &Device) {
    for update in [
        Update::Lockstep(1),
        Update::Async,
        Update::Rebuild,
        Update::Refit,
    ] {
        let [mut live, mut twin] = [0; 2].map(|_| Moving::new(device, update));
        for i in 0..24 {
            for j in 0..i % 4 {
                live.refuse(i + j);
            }
            let asked = [live.submit(i), twin.submit(i)];
            let read = [live.read(asked[0]), twin.read(asked[1])];
            assert!(read[0] == read[1], "{update:?} at {i}");
        }
        let trees = live.tracer.statistics().unwrap().generation;
        assert!(trees > 1 || update == Update::Refit, "{update:?}: {trees}");
    }
}

pub(crate) fn results_can_be_polled(device: &Device) {
    let mut live = Moving::new(device, Update::Async);
    let begun = Instant::now();
    for i in 0..4 {
        let asked = live.submit(i);
        for (done, query) in asked {
            while !live.tracer.is_done(done, query).unwrap() {
                assert!(begun.elapsed() < Duration::from_secs(60));
                thread::yield_now();
            }
        }
        let expected = live.read(asked);
        assert!(
            asked
                .iter()
                .all(|&(done, query)| live.tracer.is_done(done, query) == Ok(true))
        );
        assert!(live.read(asked) == expected);
    }
    let (done, query) = live.drop_step();
    assert_eq!(live.tracer.is_done(done, query), Err(Error::NoResult));
    let mut other = tracer(abvh::Scene::new(), device);
    let mut step = other.step(0.0);
    let query = step.trace(&live.rays, Query::Any).unwrap();
    let done = step.submit().unwrap();
    assert_eq!(live.tracer.is_done(done, query), Err(Error::NoResult));
    assert!(!other.hits(done, query).unwrap().is_hit(0));
}
