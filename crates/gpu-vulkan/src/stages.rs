//! Stages as work for the device: which kernels, over what, bound to which buffers.

use crate::VulkanBackend;
use crate::clock::Stage;
use crate::traces::{Trace, are_given};
use backend::{Query, Rays, Result};
use geom::Range;
use shaders::Params;
use shaders::work::{self, Work};

impl VulkanBackend {
    /// What all dispatches share.
    pub(crate) fn params(&self) -> Params {
        let (range, exponent) = self.reach();
        Params {
            alpha: self.pose.alpha,
            ..Params::of(exponent, &self.tree().shape).within(range)
        }
    }

    /// How far the moment's coordinates reach, and the exponent of the scene's scale.
    pub(crate) fn reach(&self) -> (Range, i32) {
        let scene = self.scene();
        (scene.animation.range(self.pose), scene.scale_exponent)
    }

    /// Records a stage; buffers are found by their names in the kernels.
    pub(crate) fn run(&mut self, stage: Stage, work: &[Work], also: Also<'_>) -> Result<()> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        let (position, key) = (self.position, self.pose.key);
        let trace = || also.trace.expect("a trace");
        let build = tree.build.as_ref();
        let instead = build.filter(|_| also.clusters);
        let find = |name: &'static str| match name {
            name if let Some(buffer) = instead.and_then(|b| b.instead_of(name)) => buffer,
            "earlier" => scene.key(key),
            "later" => scene.key(key.saturating_add(1)),
            "positions" => &scene.positions[position],
            "moving_rows" => &scene.moving_rows,
            "triangles" => &scene.triangles,
            "topology" => tree.topology(),
            "hits" => trace().hits.as_ref().expect("room for hits"),
            "occluded" => trace().blocked.as_ref().expect("room for shadows"),
            // Of a picture's rays none is given, and kernels that take both read none.
            "rays" => (trace().rays.as_ref()).unwrap_or(&scene.positions[position]),
            other => (tree.buffers.find(other))
                .or_else(|| build.and_then(|b| b.find(other)))
                .unwrap_or_else(|| panic!("no buffer named {other}")),
        };
        let slot = self.frames.record()?;
        slot.record(&self.pipelines, stage, work, find)
    }

    /// Records the stages of a trace. An empty tree has no node to trace: its stages are empty too.
    pub(crate) fn trace_stages(&mut self, query: &Query<'_>, trace: &Trace) -> Result<()> {
        let count = trace.count as u32;
        let rays = match query.rays {
            Rays::Camera(camera) if !are_given(query) => work::Rays::Camera(camera),
            _ => work::Rays::Given(count, trace.extremes),
        };
        let has_tree = self.tree().shape.leaf_count > 0;
        let mut traits = self.pipelines.traits;
        traits.rasterization = self.frames.raster_backoff.allow(traits.rasterization);
        let tracing = work::trace(self.method, self.params(), rays, query.kind, traits);
        let all = tracing
            .primary
            .iter()
            .chain(tracing.shadow.iter().flatten());
        self.pipelines.prepare_work(&self.gpu, all)?;
        let tree = self.tree.as_mut().expect("a scene was loaded");
        tree.grow_picture(&self.gpu, &self.frames, &tracing)?;
        let mut run = |stage, work: Vec<Work>| {
            let work = if has_tree { &work[..] } else { &[] };
            self.run(stage, work, Also::trace(trace))
        };
        run(Stage::TracePrimary, tracing.primary)?;
        match tracing.shadow {
            Some(shadow) => run(Stage::TraceShadow, shadow),
            None => Ok(()),
        }
    }
}

/// Buffers that belong to one stage of one frame.
#[derive(Clone, Copy, Default)]
pub(crate) struct Also<'a> {
    trace: Option<&'a Trace>,
    /// Whether leaves go to clusters of a tree to be made, not to nodes.
    clusters: bool,
}

impl<'a> Also<'a> {
    pub(crate) fn clusters() -> Self {
        Self {
            clusters: true,
            ..Self::default()
        }
    }

    fn trace(trace: &'a Trace) -> Self {
        Self {
            trace: Some(trace),
            ..Self::default()
        }
    }
}
