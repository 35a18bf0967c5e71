//! A tree made on the device: what it takes, how it is recorded, how it is read back.

use crate::WgpuBackend;
use crate::backend_impl::Stale;
use crate::buffers::{Loader, storage};
use crate::device::Gpu;
use crate::queries::Stage;
use crate::stages::Also;
use backend::{BackendError, Generation, Result};
use geom::Animation;
use shaders::rebuild::{self, Found, Room};
use shaders::{Extent, Params, Shape, work};
use std::sync::Arc;
use wgpu::Buffer;

/// Buffers by the kernels' names: see [`Room`].
pub(crate) struct BuildBuffers {
    live: Buffer,
    /// The numbers from 0 on, unless `live` is just that.
    numbers: Option<Buffer>,
    keys: Buffer,
    sorted: Buffer,
    digits: Buffer,
    boxes: Buffer,
    clusters: Buffer,
}

impl BuildBuffers {
    fn new(gpu: &Gpu, animation: &Animation) -> Result<Self> {
        let room = Room::of(animation.live_count() as u32);
        gpu.within("clusters", room.clusters)?;
        let made = Self {
            live: storage(gpu, "the live triangles", room.live)?,
            numbers: match animation.live_count() == animation.triangle_count() {
                true => None,
                false => Some(storage(gpu, "the numbers of leaves", room.live)?),
            },
            keys: storage(gpu, "keys to sort by", room.keys)?,
            sorted: storage(gpu, "sorted triangles", room.sorted)?,
            digits: storage(gpu, "counts of digits", room.digits)?,
            boxes: storage(gpu, "the scene's box", room.boxes)?,
            clusters: storage(gpu, "clusters", room.clusters)?,
        };
        let all = 0..animation.triangle_count() as u32;
        let live: Vec<u32> = all.filter(|&t| animation.is_live(t)).collect();
        let mut loader = Loader::new(gpu);
        loader.send(&live, &made.live)?;
        if let Some(numbers) = &made.numbers {
            let all: Vec<u32> = (0..live.len() as u32).collect();
            loader.send(&all, numbers)?;
        }
        Ok(made)
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let all = [&self.live, &self.keys, &self.sorted, &self.digits];
        let all = all.into_iter().chain([&self.boxes, &self.clusters]);
        all.chain(&self.numbers).map(Buffer::size).sum()
    }

    /// The buffer of that name, where there is one.
    pub(crate) fn find(&self, name: &str) -> Option<&Buffer> {
        Some(match name {
            "live" => &self.live,
            "keys" => &self.keys,
            "sorted" => &self.sorted,
            "digits" => &self.digits,
            "boxes" => &self.boxes,
            "clusters" => &self.clusters,
            _ => return None,
        })
    }

    /// What stands for a tree's buffer while leaves are made into clusters.
    pub(crate) fn instead_of(&self, name: &str) -> Option<&Buffer> {
        Some(match name {
            "topology" => &self.sorted,
            "leaf_nodes" => self.numbers.as_ref().unwrap_or(&self.live),
            "nodes" => &self.clusters,
            _ => return None,
        })
    }
}

impl WgpuBackend {
    /// Whether the tree in use was made here, of the positions at hand: it has its records and boxes.
    pub(crate) fn is_made_whole(&self) -> bool {
        let made_here = self.tree().made_here;
        let anew = made_here && self.stale < Stale::Fresh;
        assert!(!anew, "a tree made on the device is made anew");
        made_here
    }

    /// Records a tree's making: see [`shaders::rebuild`].
    pub(crate) fn make_tree(&mut self, generation: Generation) -> Result<()> {
        let animation = Arc::clone(&self.scene().animation);
        let tree = self.tree.as_mut().expect("a scene was loaded");
        if tree.build.is_none() {
            self.pipelines.prepare_trees(&self.gpu)?;
            tree.build = Some(BuildBuffers::new(&self.gpu, &animation)?);
        }
        let shape = Shape::made_on_device(animation.live_count() as u32);
        let params = Params::of(self.scene().scale_exponent, &shape);
        let sort = rebuild::sort(params, animation.vertex_count(), &shape);
        self.run(Stage::Rebuild, &sort, Also::default())?;
        let leaves = [work::leaves(self.method, params, &shape)];
        self.run(Stage::Preprocess, &leaves, Also::clusters())?;
        let mut cluster = rebuild::cluster(params, &shape);
        let extents = &mut self.frames.record(&self.gpu)?.extents;
        if extents.boxes.is_some() {
            cluster.push(rebuild::forget_refit(params));
        }
        extents.uncounted = Some(0);
        extents.refitted(Extent::Whole);
        self.run(Stage::Rebuild, &cluster, Also::default())?;
        let tree = self.tree.as_mut().expect("a scene was loaded");
        tree.made(generation, shape);
        Ok(())
    }

    /// The tree made last, after all that was submitted.
    pub(crate) fn read_tree(&mut self) -> Result<Found> {
        let scene = self.scene.as_ref().expect("a scene was loaded");
        let tree = self.tree.as_ref().expect("a scene was loaded");
        assert!(tree.made_here, "the tree in use was made on the host");
        let build = tree.build.as_ref().expect("room to make trees");
        let leaves = tree.shape.leaf_count as usize;
        let sorted: Vec<u32> = self.window.read(&self.gpu, &build.sorted, leaves)?;
        let nodes = tree.shape.node_count as usize;
        let nodes: Vec<[u32; 8]> = self.window.read(&self.gpu, &tree.nodes, nodes)?;
        let triangles = scene.animation.triangle_count() as u32;
        rebuild::read(&nodes, &sorted, triangles)
            .map_err(|e| BackendError::WrongTree(e.to_string()))
    }
}
