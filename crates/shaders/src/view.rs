//! The host's view of a tree that was read back from a device.

use crate::params::{scale, scaled_point};
use bvh_build::{BinaryTree, MAX_DEPTH};
use bvh_layout::{Topology, Treelets};
use geom::{Aabb, Animation, Point};
use std::sync::Arc;

/// The tree in use, read back from a device.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Whether the tree was built on the device.
    pub built_on_device: bool,
    /// The buffer `nodes`, of length [`crate::Shape::node_rows`].
    pub rows: &'a [[u32; 4]],
    /// The triangles of the leaves: from the buffer `sorted` if the tree was built on the device, else from the topology.
    pub triangles: &'a [u32],
    /// The scene.
    pub animation: &'a Animation,
}

/// Flags in a node reference: a leaf; a leaf of two triangles.
const LEAF: u32 = 1 << 31;
const TWO: u32 = 1 << 30;

/// A node and the location of its box.
#[derive(Clone, Copy)]
struct DeviceNode {
    bounds: StoredBox,
    below: NodeContent,
}

#[derive(Clone, Copy)]
enum StoredBox {
    /// In two rows, from this one on.
    Row(usize),
    /// Not stored: recomputed from the triangle at this index of [`View::triangles`].
    Triangle(usize),
    /// Not stored: the triangle cannot be hit.
    Nothing,
}

#[derive(Clone, Copy)]
enum NodeContent {
    /// Two nodes with rows of their own.
    Rows([usize; 2]),
    /// Two triangles that share a leaf, from this index of [`View::triangles`] on.
    Two(usize, [StoredBox; 2]),
    /// The triangle at this index of [`View::triangles`].
    One(usize),
}

impl View<'_> {
    /// Returns the topology of a tree that was built on the device.
    ///
    /// # Errors
    /// Fails if the nodes do not form a tree over all leaves, or if the tree is too deep.
    pub fn topology(&self) -> Result<Topology, String> {
        let (nodes, levels) = self.nodes()?;
        let invalid =
            |why: String| Err(format!("the device's tree is not a valid topology: {why}"));
        if levels > MAX_DEPTH as usize + 1 {
            return invalid(format!("it has {levels} levels"));
        }
        let (mut order, mut left_leaves) = (Vec::new(), Vec::new());
        if let Some(&root) = nodes.first() {
            self.add_subtree(root, &mut order, &mut left_leaves)?;
        }
        let (leaves, scene) = (self.triangles.len(), self.animation.triangle_count());
        let mut sorted = order.clone();
        sorted.sort_unstable();
        let are_distinct = sorted.len() == leaves && sorted.is_sorted_by(|a, b| a < b);
        if !are_distinct || sorted.last().is_some_and(|&last| last as usize >= scene) {
            return invalid(format!(
                "its leaves must be {leaves} distinct triangles with indices below {scene}"
            ));
        }
        let binary = BinaryTree::new(order, left_leaves);
        Ok(Topology::new(Arc::new(binary), scene))
    }

    /// Appends the leaves and inner nodes of a subtree in depth-first order. The subtree must be finite.
    fn add_subtree(
        &self,
        node: DeviceNode,
        order: &mut Vec<u32>,
        left_leaves: &mut Vec<u32>,
    ) -> Result<(), String> {
        if let NodeContent::One(place) = node.below {
            order.push(self.triangles[place]);
        }
        if let Some([left, right]) = self.children(node)? {
            let (inner, first) = (left_leaves.len(), order.len());
            left_leaves.push(0);
            self.add_subtree(left, order, left_leaves)?;
            left_leaves[inner] = (order.len() - first) as u32;
            self.add_subtree(right, order, left_leaves)?;
        }
        Ok(())
    }

    /// Returns one box per node in breadth-first order, in scene units, as [`backend::Inspect::boxes`] defines them.
    /// `positions` are those that the boxes were computed from.
    ///
    /// # Errors
    /// Fails if the tree was built on the device and [`Self::topology`] fails.
    pub fn boxes(&self, positions: &[Point]) -> Result<Vec<Aabb>, String> {
        if self.built_on_device {
            self.topology()?;
        }
        let bounds = |node: DeviceNode| match node.bounds {
            StoredBox::Row(row) => self.at_row(row),
            StoredBox::Triangle(place) => self.around(place, positions),
            StoredBox::Nothing => Aabb::EMPTY,
        };
        Ok(self.nodes()?.0.into_iter().map(bounds).collect())
    }

    /// Returns all nodes in breadth-first order, and the number of levels.
    fn nodes(&self) -> Result<(Vec<DeviceNode>, usize), String> {
        let most = (2 * self.triangles.len()).saturating_sub(1);
        let (mut nodes, mut levels) = (Vec::with_capacity(most), 0);
        nodes.extend((most > 0).then(|| self.node(0)).transpose()?);
        let mut begin = 0;
        while begin < nodes.len() {
            let end = nodes.len();
            for i in begin..end {
                let node: DeviceNode = nodes[i];
                nodes.extend(self.children(node)?.into_iter().flatten());
            }
            if nodes.len() > most {
                return Err("the device's tree has more nodes than its leaves allow".to_owned());
            }
            levels += 1;
            begin = end;
        }
        Ok((nodes, levels))
    }

    fn children(&self, node: DeviceNode) -> Result<Option<[DeviceNode; 2]>, String> {
        Ok(match node.below {
            NodeContent::Rows([left, right]) => Some([self.node(left)?, self.node(right)?]),
            NodeContent::Two(first, [a, b]) => {
                Some([(a, first), (b, first + 1)].map(|(bounds, place)| {
                    let below = NodeContent::One(place);
                    DeviceNode { bounds, below }
                }))
            }
            NodeContent::One(_) => None,
        })
    }

    /// Returns the node whose box begins at `row`.
    fn node(&self, row: usize) -> Result<DeviceNode, String> {
        let reference = self.rows[row][3];
        let bounds = StoredBox::Row(row);
        if reference & LEAF != 0 {
            let below = self.leaf(reference, bounds)?;
            return Ok(DeviceNode { bounds, below });
        }
        let first = 4 * reference as usize;
        let below = NodeContent::Rows([first, first + 2]);
        if first + 4 > self.rows.len() {
            return Err(format!("the device's tree has no node {reference}"));
        }
        Ok(DeviceNode { bounds, below })
    }

    /// Decodes a leaf. If only one of its two triangles can be hit, the leaf holds the place of that triangle.
    fn leaf(&self, reference: u32, own: StoredBox) -> Result<NodeContent, String> {
        let first = (reference & !(LEAF | TWO)) as usize;
        let shares = |place: usize| self.triangles[place] & Treelets::SHARED != 0;
        let are_two = reference & TWO != 0;
        if first + usize::from(are_two) >= self.triangles.len() {
            return Err(format!("the device's tree has no leaf {first}"));
        }
        Ok(if are_two {
            NodeContent::Two(first, [first, first + 1].map(StoredBox::Triangle))
        } else if shares(first) {
            NodeContent::Two(first, [own, StoredBox::Nothing])
        } else if first > 0 && shares(first - 1) {
            NodeContent::Two(first - 1, [StoredBox::Nothing, own])
        } else {
            NodeContent::One(first)
        })
    }

    fn at_row(&self, row: usize) -> Aabb {
        let unscale = scale(-self.animation.scale_exponent());
        let corner = |row: &[u32; 4]| [0, 1, 2].map(|i| f32::from_bits(row[i]) * unscale);
        Aabb {
            min: corner(&self.rows[row]),
            max: corner(&self.rows[row + 1]),
        }
    }

    /// Returns the box of a triangle, with the corners that kernels use.
    fn around(&self, place: usize, positions: &[Point]) -> Aabb {
        let exponent = self.animation.scale_exponent();
        let triangle = self.triangles[place] & !Treelets::SHARED;
        let corners = self.animation.triangles()[triangle as usize].map(|v| {
            let scaled = scaled_point(positions[v as usize], exponent);
            scaled.map(|x| x * scale(-exponent))
        });
        let all = corners.into_iter();
        all.fold(Aabb::EMPTY, Aabb::with_point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a tree whose nodes have these references, in a scene of 100 triangles.
    fn read(references: &[u32], triangles: &[u32]) -> Result<Topology, String> {
        let rows = references.iter().flat_map(|&r| [[0, 0, 0, r], [0; 4]]);
        let view = View {
            built_on_device: true,
            rows: &rows.collect::<Vec<_>>(),
            triangles,
            animation: &Animation::new(vec![vec![[0.0; 3]]], vec![[0; 3]; 100]).unwrap(),
        };
        view.topology()
    }

    #[test]
    fn rejects_malformed_trees() {
        // The root's left child is leaf 1, its right child holds leaves 0 and 2. Element 1 is unused.
        let whole = [1, 0, LEAF | 1, 2, LEAF, LEAF | 2];
        let tree = read(&whole, &[7, 8, 99]).unwrap();
        assert_eq!(tree.binary().order(), [8, 7, 99]);
        assert_eq!(tree.binary().left_leaves(), [1, 1]);
        let broken = |at: usize, link| {
            let mut nodes = whole;
            nodes[at] = link;
            read(&nodes, &[7, 8, 99]).unwrap_err()
        };
        assert!(broken(4, 4).ends_with("no node 4"));
        assert!(broken(4, 1).ends_with("more nodes than its leaves allow"));
        assert!(broken(4, LEAF | 3).ends_with("no leaf 3"));
        // One triangle twice and another one missing, or one missing.
        for (at, link) in [(4, LEAF | 1), (2, LEAF), (3, LEAF | 2)] {
            assert!(broken(at, link).contains("is not a valid topology: "));
        }
        // One triangle in two places, or not in the scene.
        for triangles in [[7, 8, 7], [7, 8, 100]] {
            let error = read(&whole, &triangles).unwrap_err();
            let rule = "must be 3 distinct triangles with indices below 100";
            assert!(error.contains(rule), "{error}");
        }
    }

    #[test]
    fn rejects_too_deep_trees() {
        let chain = |leaves: u32| {
            let pairs = (1..leaves - 1).flat_map(|k| [LEAF | (k - 1), k + 1]);
            let last = [leaves - 2, leaves - 1].map(|leaf| LEAF | leaf);
            let references: Vec<u32> = [1, 0].into_iter().chain(pairs).chain(last).collect();
            read(&references, &(0..leaves).collect::<Vec<_>>())
        };
        assert_eq!(chain(MAX_DEPTH + 1).unwrap().binary().depth(0), MAX_DEPTH);
        assert!(
            chain(MAX_DEPTH + 2)
                .unwrap_err()
                .ends_with("it has 66 levels")
        );
    }
}
