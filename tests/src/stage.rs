//! A backend with one scene and a tree built at any time.

use crate::is_full;
use backend::{Backend, Generation, Hits, Intersector, QueryKind, Rays};
use conformance::stage::{record_refit, trace_and_wait, tree_at};
use geom::{Animation, Camera, Point, Ray};
use scene::Viewpoint;
use std::sync::Arc;

/// A backend that traces one animation.
pub struct Stage {
    backend: Box<dyn Backend>,
    animation: Arc<Animation>,
    generation: Generation,
}

impl Stage {
    /// Creates backend `cpu-ref` with `threads` threads, and loads the animation.
    pub fn new(animation: &Arc<Animation>, intersector: Intersector, threads: usize) -> Self {
        let backend = cpu_ref::CpuBackend::new(Some(threads)).expect("threads can be had");
        Self::over(Box::new(backend), animation, intersector)
    }

    /// Loads the animation on any backend.
    pub fn over(
        mut backend: Box<dyn Backend>,
        animation: &Arc<Animation>,
        intersector: Intersector,
    ) -> Self {
        let loaded = backend.load(Arc::clone(animation), intersector);
        loaded.expect("the scene fits");
        Self {
            backend,
            animation: Arc::clone(animation),
            generation: Generation(0),
        }
    }

    /// Returns the backend, for another scene.
    pub fn into_backend(self) -> Box<dyn Backend> {
        self.backend
    }

    /// Adopts a tree built from the vertices at `time`.
    pub fn adopt_tree_at(&mut self, time: f64) {
        self.generation.0 += 1;
        let tree = tree_at(&self.animation, time);
        let adopted = self.backend.adopt(&tree, self.generation);
        adopted.expect("the tree fits");
    }

    /// Returns the closest hits of rays at `time`, with the current tree.
    pub fn closest(&mut self, time: f64, rays: &[Ray]) -> Hits {
        self.trace(time, Rays::List(rays), QueryKind::Closest)
    }

    /// Traces any rays at `time`.
    pub fn trace(&mut self, time: f64, rays: Rays<'_>, kind: QueryKind) -> Hits {
        let backend = self.backend.as_mut();
        let done = record_refit(backend, &self.animation, time)
            .and_then(|()| trace_and_wait(backend, rays, kind));
        done.expect("every stage runs").hits
    }
}

/// Returns the camera that the program would choose.
pub fn camera(animation: &Animation, size: [u32; 2]) -> Camera {
    let view = Viewpoint::framing(animation, 40.0, size);
    view.camera(size).expect("every scene can be framed")
}

/// Returns that camera's rays: 240 by 160 pixels in the full tier, else 120 by 80.
pub fn pixels(animation: &Animation) -> Vec<Ray> {
    let size = if is_full() { [240, 160] } else { [120, 80] };
    camera(animation, size).rays().collect()
}

/// Returns the light that the program would choose.
pub fn light(animation: &Animation) -> Point {
    Viewpoint::framing(animation, 40.0, [64, 64]).light
}

/// Returns `count` different colours.
pub fn colours(count: usize) -> Vec<[u8; 3]> {
    let of = |t: usize| [t, t * 37, t * 101].map(|channel| channel as u8);
    (0..count).map(of).collect()
}
