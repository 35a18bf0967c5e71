//! A backend with one scene on it, and a tree of any age.

use backend::{Backend, Generation, Hits, Intersector, Layout, Method, Query, Result};
use bvh_build::Cancel;
use geom::{Animation, Point, Pose};
use pipeline::TreeBuilder;
use std::sync::Arc;

/// A backend that traces one animation.
pub struct Stage {
    backend: Box<dyn Backend>,
    animation: Arc<Animation>,
    tools: TreeBuilder,
    generation: Generation,
}

impl Stage {
    /// The `cpu` backend with so many threads.
    ///
    /// # Panics
    /// If it cannot be had or refuses the scene.
    #[must_use]
    pub fn new(animation: &Arc<Animation>, intersector: Intersector, threads: usize) -> Self {
        let backend = cpu_ref::CpuBackend::new(Some(threads)).expect("threads can be had");
        Self::over(Box::new(backend), animation, intersector)
    }

    /// Any backend.
    ///
    /// # Panics
    /// If it refuses the scene.
    #[must_use]
    pub fn over(
        backend: Box<dyn Backend>,
        animation: &Arc<Animation>,
        intersector: Intersector,
    ) -> Self {
        let layout = Layout::Bvh2;
        let method = Method {
            intersector,
            layout,
        };
        Self::by(backend, animation, method)
    }

    /// Any backend, by any method.
    ///
    /// # Panics
    /// If it refuses the scene.
    #[must_use]
    pub fn by(backend: Box<dyn Backend>, animation: &Arc<Animation>, method: Method) -> Self {
        let mut stage = Self {
            backend,
            animation: Arc::clone(animation),
            tools: TreeBuilder::new(),
            generation: Generation(0),
        };
        stage
            .backend
            .load(Arc::clone(animation), method)
            .expect("the scene fits");
        stage
    }

    /// The backend, for another scene.
    #[must_use]
    pub fn into_backend(self) -> Box<dyn Backend> {
        self.backend
    }

    /// Adopts a tree built from the vertices at `time`.
    ///
    /// # Panics
    /// If the build or the adoption fails; likewise below.
    pub fn plant(&mut self, time: f64) {
        let positions = positions(&self.animation, self.animation.pose(time));
        let built = self
            .tools
            .build(&self.animation, &positions, &Cancel::new())
            .expect("nobody cancels");
        self.generation.0 += 1;
        self.backend
            .adopt(&built.topology, self.generation)
            .expect("the tree fits");
    }

    /// What `query` hits at `time`, with the tree that is planted.
    ///
    /// # Panics
    /// If a stage fails.
    pub fn trace(&mut self, time: f64, query: Query<'_>) -> Hits {
        self.try_trace(time, query).expect("every stage runs")
    }

    /// Likewise.
    ///
    /// # Errors
    /// A stage fails.
    pub fn try_trace(&mut self, time: f64, query: Query<'_>) -> Result<Hits> {
        let mut hits = Hits::default();
        self.backend.interpolate(self.animation.pose(time))?;
        self.backend.preprocess()?;
        self.backend.refit()?;
        self.backend.trace(query)?;
        let ticket = self.backend.submit()?;
        self.backend.wait(ticket)?;
        self.backend.hits(ticket, &mut hits)?;
        Ok(hits)
    }
}

/// Every vertex at `pose`, by the formula that all backends repeat.
#[must_use]
pub fn positions(animation: &Animation, pose: Pose) -> Vec<Point> {
    let vertices = 0..animation.vertex_count() as u32;
    vertices.map(|v| animation.vertex(pose, v)).collect()
}

/// Times that tell: both ends, a key frame, and between key frames.
#[must_use]
pub fn telling_times(animation: &Animation) -> Vec<f64> {
    let end = animation.end();
    let mut times = vec![0.0, (0.37 * end).floor(), 0.618 * end, end];
    times.dedup();
    times
}
