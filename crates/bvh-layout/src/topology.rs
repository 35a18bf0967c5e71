//! A binary tree of a scene, and its forms for backends.

use crate::{BlockTree, CollapseOptions, Treelets};
use bvh_build::{BinaryTree, MAX_DEPTH};
use geom::{Animation, StaticParts};
use std::sync::Arc;
use std::sync::atomic::AtomicU32;

/// A binary tree over triangles of a scene. May also contain the same tree as [`Treelets`] and as a [`BlockTree`].
///
/// No part contains boxes. The binary tree and the blocks are reference-counted, because builders and backends keep using
/// them after a backend has made the topology its current tree (`Backend::adopt`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    triangle_count: usize,
    binary: Arc<BinaryTree>,
    treelets: Option<Box<Treelets>>,
    blocks: Option<Arc<BlockTree>>,
}

impl Topology {
    /// Creates the topology of a tree for a scene of `triangle_count` triangles, without treelets and blocks. The
    /// leaves must have distinct triangles, as in all trees that `bvh_build` builds.
    ///
    /// # Panics
    /// If `triangle_count` exceeds [`Animation::MAX_TRIANGLES`], if a triangle of the tree is not below it, or if the
    /// tree is deeper than [`MAX_DEPTH`].
    #[must_use]
    pub fn new(binary: Arc<BinaryTree>, triangle_count: usize) -> Self {
        assert!(
            triangle_count <= Animation::MAX_TRIANGLES,
            "{triangle_count} triangles are too many for a topology"
        );
        if let Some(greatest) = binary.order().iter().copied().max() {
            assert!(
                (greatest as usize) < triangle_count,
                "the tree contains triangle {greatest}, the scene has only {triangle_count}"
            );
        }
        let depth = binary.depth(MAX_DEPTH);
        assert!(
            depth <= MAX_DEPTH,
            "the tree has depth {depth}, the limit is {MAX_DEPTH}"
        );
        Self {
            triangle_count,
            binary,
            treelets: None,
            blocks: None,
        }
    }

    /// Adds treelets of the same tree.
    pub(crate) fn and_treelets(self, treelets: Treelets) -> Self {
        let treelets = Some(Box::new(treelets));
        Self { treelets, ..self }
    }

    /// Adds lists of the moving treelets ([`Treelets::moving`]), and the treelets if they are missing. Runs in parallel.
    /// Adds no lists if more than half would be listed.
    ///
    /// # Panics
    /// If `parts` does not belong to the tree's scene.
    #[must_use]
    pub fn with_moving(mut self, parts: &StaticParts) -> Self {
        assert_eq!(parts.triangles.len(), self.triangle_count);
        let treelets = match self.treelets.take() {
            Some(treelets) => *treelets,
            None => Treelets::of(&self.binary),
        };
        self.and_treelets(treelets.with_moving(parts))
    }

    /// Adds the tree's eight-wide form, in parallel. See [`BlockTree::of`] for the parameters.
    ///
    /// # Panics
    /// If the tree does not belong to a scene of these triangles.
    #[must_use]
    pub fn with_blocks(self, triangles: &[[u32; 3]], options: CollapseOptions<'_>) -> Self {
        let blocks = Some(Arc::new(BlockTree::of(&self.binary, triangles, options)));
        Self { blocks, ..self }
    }

    /// Returns the memory of the treelets for reuse by [`Converter`]. Empty without treelets.
    pub fn into_spare(self) -> Vec<u32> {
        self.treelets.map_or_else(Vec::new, |t| t.words)
    }

    /// Returns the number of triangles in the scene, including those that are not in the tree.
    pub fn triangle_count(&self) -> usize {
        self.triangle_count
    }

    /// Returns the binary tree.
    pub fn binary(&self) -> &Arc<BinaryTree> {
        &self.binary
    }

    /// Returns the tree's treelets, if it has them.
    pub fn treelets(&self) -> Option<&Treelets> {
        self.treelets.as_deref()
    }

    /// Returns the tree's eight-wide form, if it has one.
    pub fn blocks(&self) -> Option<&Arc<BlockTree>> {
        self.blocks.as_ref()
    }

    /// Returns the number of bytes to upload: those of the treelets if present, otherwise those of the binary tree, which
    /// takes 8 bytes per triangle.
    pub fn upload_bytes(&self) -> usize {
        let binary = size_of_val(self.binary.order()) + size_of_val(self.binary.left_leaves());
        self.treelets().map_or(binary, Treelets::bytes)
    }
}

/// Creates topologies with treelets. Keeps its scratch memory between calls: about one word per triangle, and a second
/// one for trees of at most [`WideTree::MOST_TRIANGLES`](crate::WideTree::MOST_TRIANGLES) triangles.
#[derive(Debug, Default)]
pub struct Converter {
    /// Inner nodes of all treelets, with unused words between treelets.
    pub(crate) inner: Vec<u32>,
    /// Treelet and number of each inner node, as in `treelets::fill::Places`. Empty for trees that are too large for a
    /// `WideTree`.
    pub(crate) places: Vec<AtomicU32>,
}

impl Converter {
    /// Creates the topology of `tree` with treelets, in the rayon pool that the caller installed. `reuse` is the memory of
    /// an old topology: see [`Topology::into_spare`].
    ///
    /// # Panics
    /// As [`Topology::new`].
    #[must_use]
    pub fn convert(
        &mut self,
        tree: Arc<BinaryTree>,
        triangle_count: usize,
        reuse: Vec<u32>,
    ) -> Topology {
        let (topology, treelets) = rayon::join(
            || Topology::new(Arc::clone(&tree), triangle_count),
            || Treelets::of_in(&tree, self, reuse),
        );
        topology.and_treelets(treelets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{parts, random_tree, scene_triangle_count, shapes};

    #[test]
    fn reused_memory_does_not_change_results() {
        let (mut converter, mut spare) = (Converter::default(), Vec::new());
        let (up, down) = (shapes().into_iter(), shapes().into_iter().rev());
        for tree in up.chain(down).map(Arc::new) {
            let count = scene_triangle_count(&tree);
            let fresh = Converter::default().convert(Arc::clone(&tree), count, Vec::new());
            let reused = converter.convert(tree, fresh.triangle_count(), spare);
            assert_eq!(reused, fresh);
            spare = reused.into_spare();
            spare.fill(u32::MAX);
            converter.inner.fill(u32::MAX);
            let places = converter.places.iter_mut();
            places.for_each(|place| *place.get_mut() = u32::MAX);
        }
    }

    #[test]
    fn parts_are_independent() {
        let tree = Arc::new(random_tree(600, 4));
        let plain = Topology::new(Arc::clone(&tree), scene_triangle_count(&tree));
        assert!(plain.treelets().is_none() && plain.blocks().is_none());
        let triangles = vec![[0; 3]; scene_triangle_count(&tree)];
        let options = CollapseOptions::default();
        let parts = parts(scene_triangle_count(&tree), |t| t == tree.order()[9]);
        let both = plain.with_blocks(&triangles, options).with_moving(&parts);
        let treelets = Treelets::of(&tree).with_moving(&parts);
        assert!(treelets.moving.is_some() && both.treelets() == Some(&treelets));
        assert_eq!(
            **both.blocks().unwrap(),
            BlockTree::of(&tree, &triangles, options)
        );
        assert!(Arc::ptr_eq(both.binary(), &tree));
    }

    #[test]
    fn upload_bytes_per_triangle_are_bounded() {
        let tree = Arc::new(random_tree(200_000, 1));
        let plain = Topology::new(Arc::clone(&tree), scene_triangle_count(&tree));
        assert_eq!(plain.upload_bytes(), 8 * 200_000 - 4);
        let with_treelets = Converter::default().convert(tree, plain.triangle_count(), Vec::new());
        let bytes = with_treelets.upload_bytes();
        assert!((1_200_000..1_500_000).contains(&bytes), "{bytes}");
        assert_eq!(Topology::default().upload_bytes(), 0);
    }

    #[test]
    #[should_panic(expected = "contains triangle")]
    fn panics_on_trees_of_other_scenes() {
        let tree = random_tree(100, 1);
        let greatest = *tree.order().iter().max().unwrap();
        let _ = Topology::new(Arc::new(tree), greatest as usize);
    }

    #[test]
    #[should_panic(expected = "has depth 299, the limit is 64")]
    fn panics_on_too_deep_trees() {
        let (order, left_leaves) = ((0..300).collect(), (0..299).map(|i| 299 - i).collect());
        let _ = Topology::new(Arc::new(BinaryTree::new(order, left_leaves)), 300);
    }
}
