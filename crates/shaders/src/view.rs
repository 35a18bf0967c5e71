//! A tree as the host sees it when it looks at a device's memory.

use crate::rebuild::{BrokenTree, Found, links_of_rows, read};
use crate::{Shape, params::scale, unfold::unfold};
use backend::Layout;
use bvh_layout::Topology;
use geom::{Aabb, Animation, Point};

/// What a device holds of the tree in use.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The tree's shape, and whether it was made on the device.
    pub shape: &'a Shape,
    /// Likewise.
    pub made_on_device: bool,
    /// The buffer `nodes`, [`Shape::node_rows`] long.
    pub rows: &'a [[u32; 4]],
    /// The leaves' triangles: of the buffer `sorted` where the tree was made on the device, else of the record.
    pub triangles: &'a [u32],
    /// The scene.
    pub animation: &'a Animation,
}

impl View<'_> {
    /// The record of a tree made on the device.
    ///
    /// # Errors
    /// What the device made is no tree.
    pub fn topology(&self) -> Result<Topology, BrokenTree> {
        Ok(self.found()?.topology)
    }

    /// One box a node in breadth-first order, in the scene's units, as [`backend::Inspect::boxes`] gives them.
    /// `positions` are those that the boxes were made of.
    ///
    /// # Errors
    /// The tree was made on the device and is none.
    pub fn boxes(&self, positions: &[Point]) -> Result<Vec<Aabb>, BrokenTree> {
        let found = self.made_on_device.then(|| self.found()).transpose()?;
        if self.shape.layout == Layout::Fast {
            let rows: &[[f32; 4]] = bytemuck::cast_slice(self.rows);
            return Ok(unfold(rows, self.triangles, self.animation, positions));
        }
        let boxes = self.boxes_of_nodes();
        Ok(match found {
            Some(found) => found.in_order(&boxes),
            None => boxes,
        })
    }

    fn found(&self) -> Result<Found, BrokenTree> {
        let links = match self.shape.layout {
            Layout::Bvh2 => self.rows.iter().step_by(2).map(|row| row[3]).collect(),
            Layout::Fast => links_of_rows(self.rows, self.triangles.len())?,
        };
        let scene = self.animation.triangle_count() as u32;
        read(&links, self.triangles, scene)
    }

    fn boxes_of_nodes(&self) -> Vec<Aabb> {
        let unscale = scale(-self.animation.scale_exponent());
        let point = |row: &[u32; 4]| [0, 1, 2].map(|i| f32::from_bits(row[i]) * unscale);
        let pairs = self.rows.chunks_exact(2);
        pairs
            .map(|pair| Aabb {
                min: point(&pair[0]),
                max: point(&pair[1]),
            })
            .collect()
    }
}
