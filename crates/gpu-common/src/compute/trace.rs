//! Traces and their output buffers.

use super::ComputeBackend;
use crate::traces::ray_source;
use crate::tree::unless_too_large;
use crate::{GpuDevice, NextStage, Stage, TraceBuffers};
use backend::{Intersector, Query, Result, Ticket};
use shaders::work::{self, TraceInput};
use shaders::{BufferName, Params};

impl<D: GpuDevice> ComputeBackend<D> {
    /// Records the stages of query `index` of a batch of `count` queries.
    pub(super) fn trace_one_of(
        &mut self,
        query: &Query<'_>,
        index: usize,
        count: usize,
    ) -> Result<()> {
        assert!(
            self.engine.next_stage == NextStage::Trace,
            "a stale tree must not be traced"
        );
        let pending = self.engine.frames.pending.len();
        assert!(pending == index, "only one call of trace per submission");
        if query.kind.light().is_some() {
            // The offset of shadow rays depends on `CoordinateRange::clearance`, which only the host computes.
            let range = self.engine.scene().animation.range(self.engine.pose);
            self.range = Some(range);
        }
        let params = self.params();
        let intersector = self.intersector;
        let engine = &mut self.engine;
        let old = engine.frames.expired();
        let trace = TraceBuffers::new(&mut engine.gpu, query, intersector, old)?;
        let mut traits = engine.pipelines.traits;
        traits.rasterizes = engine.frames.raster_backoff.allow(traits.rasterizes);
        let input = TraceInput {
            intersector,
            params,
            rays: ray_source(query),
            kind: query.kind,
        };
        let mut tracing = work::trace(input, traits);
        let trees = self.trees.as_mut().expect("a scene was loaded");
        let grown = trees.grow_picture_buffers(&engine.gpu, &mut engine.frames, &tracing);
        if unless_too_large(grown)?.is_none() {
            // Single rays need no such buffers.
            traits.packets = None;
            tracing = work::trace(input, traits);
        }
        if let Some(first) = tracing.primary.first_mut().filter(|_| index > 0) {
            // Traces of a batch write different buffers, so they may run concurrently.
            first.alongside = true;
        }
        if trace.copies_results {
            tracing.primary.push(work::copy_points(trace.count, [0; 2]));
        }
        for work in &mut tracing.primary {
            work.trace_index = index;
        }
        // The last trace's stage times the whole batch.
        let primary = (index + 1 == count).then_some(Stage::TracePrimary);
        let stages = [
            (primary, Some(tracing.primary)),
            (Some(Stage::TraceShadow), tracing.shadow),
        ];
        let recorded = stages.into_iter().try_for_each(|(stage, work)| {
            let Some(work) = work else { return Ok(()) };
            let own = |name| trace.get(name).or_else(|| trees.get(name));
            engine.run(stage, &work, own)
        });
        // If the second stage fails, the recorded first one still uses the trace's buffers.
        engine.frames.pending.push(trace);
        recorded
    }

    /// Returns the inputs of [`shaders::MODULE`]: parameters, nodes, triangle records and range. Returns `None` if the
    /// boxes are stale, commands are recorded but not submitted, or the intersector is not `watertight`.
    pub fn traced_scene(&self) -> Option<(Params, [&D::Buffer; 3])> {
        let engine = &self.engine;
        let is_current = engine.next_stage == NextStage::Trace && engine.frames.recorder.is_empty();
        let is_ready = is_current && self.intersector == Intersector::Watertight;
        let (params, trees) = (self.params().for_module(), self.trees());
        let scene = self.engine.scene();
        let buffer = |name| trees.get(name).or_else(|| scene.get(name, 0, 0));
        let names = [BufferName::Nodes, BufferName::Records, BufferName::Range];
        let [nodes, records, range] = names.map(buffer);
        is_ready.then_some((params, [nodes?, records?, range?]))
    }

    /// Returns the buffer that contains or will contain the closest hits of query `index` of a submission. Returns
    /// `None` for an any-hit query.
    ///
    /// # Panics
    /// If the trace does not exist or has expired.
    pub fn hits_buffer(&mut self, ticket: Ticket, index: usize) -> Option<&D::Buffer> {
        self.engine.frames.trace(ticket, index).closest_hits()
    }
}
