//! A backend that takes another layout for the usual one, so that every law is tried on it.

use backend::{
    Backend, Device, DeviceBytes, FrameReport, Generation, Hits, Inspect, Layout, Method, Query,
    Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Animation, Pose};
use std::sync::Arc;

/// `inner`, which lays trees out by `layout` whenever it is asked for the usual layout.
pub(crate) struct LayoutAdapter<'a> {
    pub(crate) inner: &'a mut dyn Backend,
    pub(crate) layout: Layout,
}

/// Whether `backend` has that layout.
pub(crate) fn lays(backend: &dyn Backend, layout: Layout) -> bool {
    backend.supports(Method {
        layout,
        ..Method::default()
    })
}

impl LayoutAdapter<'_> {
    fn adapt(&self, method: Method) -> Method {
        match method.layout {
            Layout::Bvh2 => Method {
                layout: self.layout,
                ..method
            },
            _ => method,
        }
    }
}

impl Backend for LayoutAdapter<'_> {
    fn device(&self) -> &Device {
        self.inner.device()
    }

    fn supports(&self, method: Method) -> bool {
        self.inner.supports(self.adapt(method))
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        self.inner.load(animation, self.adapt(method))
    }

    fn makes_own_trees(&self) -> bool {
        self.inner.makes_own_trees()
    }

    fn check_rebuild(&self) -> Result<()> {
        self.inner.check_rebuild()
    }

    fn rebuild(&mut self, generation: Generation) -> Result<()> {
        self.inner.rebuild(generation)
    }

    fn adopt(&mut self, tree: &Topology, generation: Generation) -> Result<()> {
        self.inner.adopt(tree, generation)
    }

    fn wants_treelets(&self) -> bool {
        self.inner.wants_treelets()
    }

    fn wants_blocks(&self) -> bool {
        self.inner.wants_blocks()
    }

    fn interpolate(&mut self, pose: Pose) -> Result<()> {
        self.inner.interpolate(pose)
    }

    fn preprocess(&mut self) -> Result<()> {
        self.inner.preprocess()
    }

    fn refit(&mut self) -> Result<()> {
        self.inner.refit()
    }

    fn trace(&mut self, query: Query<'_>) -> Result<()> {
        self.inner.trace(query)
    }

    fn request_positions(&mut self) -> Result<()> {
        self.inner.request_positions()
    }

    fn submit(&mut self) -> Result<Ticket> {
        self.inner.submit()
    }

    fn wait(&mut self, ticket: Ticket) -> Result<FrameReport> {
        self.inner.wait(ticket)
    }

    fn hits(&mut self, ticket: Ticket, out: &mut Hits) -> Result<()> {
        self.inner.hits(ticket, out)
    }

    fn take_positions(&mut self) -> Result<Option<(Ticket, Snapshot)>> {
        self.inner.take_positions()
    }

    fn device_bytes(&self) -> Option<DeviceBytes> {
        self.inner.device_bytes()
    }

    fn inspect(&mut self) -> &mut dyn Inspect {
        self.inner.inspect()
    }
}
