//! Access to the output of a stage.

use crate::device::read_all;
use crate::{ComputeBackend, GpuDevice};
use backend::{BackendError, Inspect, Result};
use bvh_layout::Topology;
use bytemuck::Pod;
use geom::{Aabb, Point};
use shaders::{BufferName, View};

impl<D: GpuDevice> Inspect for ComputeBackend<D> {
    fn positions(&mut self) -> Result<Vec<Point>> {
        let engine = &mut self.engine;
        engine.gpu.wait(None)?;
        let scene = engine.scene.as_ref().expect("a scene was loaded");
        let from = &scene.positions[engine.position];
        read_all(&mut engine.gpu, from, scene.animation.vertex_count())
    }

    fn boxes(&mut self) -> Result<Vec<Aabb>> {
        let positions = self.positions()?;
        self.view(|tree| tree.boxes(&positions))
    }

    fn rebuilt(&mut self) -> Result<Topology> {
        let capabilities = &self.engine.info.device.capabilities;
        capabilities.device_rebuild.clone()?;
        let built_on_device = self.trees().built_on_device;
        assert!(built_on_device, "the tree in use was built on the host");
        self.view(|tree| tree.topology())
    }

    fn complaints(&mut self) -> Vec<String> {
        self.engine.gpu.info().complaints
    }
}

impl<D: GpuDevice> ComputeBackend<D> {
    /// Waits for all submissions and reads the first elements of a buffer of the current tree, for tests and dumps.
    ///
    /// # Panics
    /// If the tree has no such buffer.
    pub fn read_tree<T: Pod>(&mut self, name: BufferName, count: usize) -> Result<Vec<T>> {
        let trees = self.trees.as_ref().expect("a scene was loaded");
        let buffer = trees.get(name).expect("the tree has this buffer");
        self.engine.gpu.wait(None)?;
        read_all(&mut self.engine.gpu, buffer, count)
    }

    /// Reads the current tree back, after all submissions, and passes it to `read`.
    fn view<T>(&mut self, read: impl Fn(&View<'_>) -> std::result::Result<T, String>) -> Result<T> {
        let shape = self.trees().current.shape.clone();
        let built_on_device = self.trees().built_on_device;
        let leaves = shape.leaf_count as usize;
        let (name, at) = if built_on_device {
            (BufferName::Sorted, 0)
        } else {
            let at = shape.params.leaf_triangles_at as usize;
            (BufferName::Topology, at)
        };
        let words: Vec<u32> = self.read_tree(name, at + leaves)?;
        let rows = self.read_tree(BufferName::Nodes, shape.node_rows as usize)?;
        let output = read(&View {
            built_on_device,
            rows: &rows,
            triangles: &words[at..],
            animation: &self.engine.scene().animation,
        });
        output.map_err(BackendError::WrongTree)
    }
}
