//! A backend that takes another layout for the usual one, so that every law is tried on it.

use backend::{
    Backend, BackendError, Device, DeviceBytes, FrameReport, Generation, Hits, Inspect, Layout,
    Method, Query, Result, Snapshot, Ticket,
};
use bvh_layout::Topology;
use geom::{Animation, Pose};
use std::sync::Arc;

/// `inner`, which lays trees out by `layout` whenever it is asked for the usual layout.
pub(crate) struct LayoutAdapter<'a> {
    pub(crate) inner: &'a mut dyn Backend,
    pub(crate) layout: Layout,
}

/// Whether `backend` traces the scene with that layout. A failure of another kind is for the law to see.
pub(crate) fn lays(backend: &mut dyn Backend, animation: &Arc<Animation>, layout: Layout) -> bool {
    let method = Method {
        layout,
        ..Method::default()
    };
    let loaded = backend.load(Arc::clone(animation), method);
    !matches!(loaded, Err(BackendError::Unsupported { .. }))
}

impl Backend for LayoutAdapter<'_> {
    fn device(&self) -> &Device {
        self.inner.device()
    }

    fn load(&mut self, animation: Arc<Animation>, method: Method) -> Result<()> {
        let layout = match method.layout {
            Layout::Bvh2 => self.layout,
            other => other,
        };
        self.inner.load(animation, Method { layout, ..method })
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
