//! A device's tree read back as a record.

use bvh_layout::{RecordError, Topology};

const LEAF: u32 = 1 << 31;

/// A tree as its nodes show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The record, which has every property that any record has.
    pub topology: Topology,
    /// Where each node of the record lies among the device's.
    pub places: Vec<u32>,
}

impl Found {
    /// What the device's nodes have, in the record's node order.
    #[must_use]
    pub fn in_order<T: Copy>(&self, of_nodes: &[T]) -> Vec<T> {
        self.places.iter().map(|&i| of_nodes[i as usize]).collect()
    }
}

/// What is wrong with a device's tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BrokenTree {
    /// A node's child lies beyond all nodes.
    Child(u32),
    /// A leaf lies beyond all leaves.
    Leaf(u32),
    /// More nodes hang together than there are: some lie below themselves or below two others.
    Endless,
    /// The record made of it has not the properties of a record.
    Record(RecordError),
}

impl std::fmt::Display for BrokenTree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Child(node) => write!(f, "the device's tree has a child at node {node}"),
            Self::Leaf(leaf) => write!(f, "the device's tree has a leaf {leaf}"),
            Self::Endless => write!(f, "the device's tree goes on without end"),
            Self::Record(e) => write!(f, "the device's tree makes no record: {e}"),
        }
    }
}

/// The record of a tree whose `nodes` the device made, over leaves of these
/// `triangles`, in a scene of so many. Word 3 of a node is its link (see cluster.wgsl).
///
/// # Errors
/// The nodes make no tree over all the leaves.
pub fn read(
    nodes: &[[u32; 8]],
    triangles: &[u32],
    scene_triangles: u32,
) -> Result<Found, BrokenTree> {
    let Order {
        places,
        inner,
        levels,
    } = order(nodes)?;
    let is_inner = |i: &usize| inner.binary_search(i).is_ok();
    let leaves: Vec<usize> = (0..places.len()).filter(|i| !is_inner(i)).collect();
    let mut named = Vec::with_capacity(leaves.len());
    for &i in &leaves {
        let leaf = nodes[places[i] as usize][3] & !LEAF;
        let triangle = triangles.get(leaf as usize);
        named.push(*triangle.ok_or(BrokenTree::Leaf(leaf))?);
    }
    let counts = [scene_triangles, triangles.len() as u32];
    let words = words(&levels, &leaves, &named, counts);
    let topology = Topology::from_words(words).map_err(BrokenTree::Record)?;
    Ok(Found { topology, places })
}

/// Nodes level by level.
struct Order {
    /// Where each lies on the device.
    places: Vec<u32>,
    /// Those that are inner nodes.
    inner: Vec<usize>,
    /// How many of each level are.
    levels: Vec<u32>,
}

fn order(nodes: &[[u32; 8]]) -> Result<Order, BrokenTree> {
    let mut places = Vec::with_capacity(nodes.len());
    let (mut inner, mut levels) = (Vec::new(), Vec::new());
    places.extend((!nodes.is_empty()).then_some(0));
    let mut begin = 0;
    while begin < places.len() {
        let (end, before) = (places.len(), inner.len());
        for i in begin..end {
            let link = nodes[places[i] as usize][3];
            if link & LEAF == 0 {
                if link as usize + 1 >= nodes.len() {
                    return Err(BrokenTree::Child(link));
                }
                inner.push(i);
                places.extend([link, link + 1]);
            }
        }
        if places.len() > nodes.len() {
            return Err(BrokenTree::Endless);
        }
        levels.push((inner.len() - before) as u32);
        begin = end;
    }
    Ok(Order {
        places,
        inner,
        levels,
    })
}

/// A record as [`Topology`] describes it.
fn words(levels: &[u32], leaves: &[usize], named: &[u32], [scene, count]: [u32; 2]) -> Vec<u32> {
    let nodes = (2 * count as usize).saturating_sub(1);
    let mut bits = vec![0_u32; nodes.div_ceil(32)];
    for &leaf in leaves.iter().filter(|&&leaf| leaf < nodes) {
        bits[leaf / 32] |= 1 << (leaf % 32);
    }
    let ranks = bits.iter().scan(0, |sum, word| {
        let before = *sum;
        *sum += word.count_ones();
        Some(before)
    });
    let header = [
        Topology::MAGIC,
        Topology::VERSION,
        scene,
        count,
        levels.len() as u32,
        0,
        0,
        0,
    ];
    let mut words = header.to_vec();
    words.extend(levels);
    words.extend(&bits);
    words.extend(ranks);
    words.extend(named);
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(link: u32) -> [u32; 8] {
        [0, 0, 0, link, 0, 0, 0, 0]
    }

    /// The root's left child is leaf 1, its right child holds leaves 0 and 2.
    fn three() -> Vec<[u32; 8]> {
        [1, LEAF | 1, 3, LEAF, LEAF | 2].map(node).to_vec()
    }

    #[test]
    fn a_tree_is_read_level_by_level() {
        let found = read(&three(), &[7, 8, 9], 10).unwrap();
        assert_eq!(found.topology.leaf_triangles(), [8, 7, 9]);
        assert_eq!(found.places, [0, 1, 2, 3, 4]);
        let levels: Vec<u32> = found
            .topology
            .levels()
            .map(|l| l.inner.len() as u32)
            .collect();
        assert_eq!(levels, [1, 1, 0]);
    }

    #[test]
    fn no_leaf_and_one_leaf_are_trees() {
        assert_eq!(read(&[], &[], 3).unwrap().topology.leaf_count(), 0);
        let lone = read(&[node(LEAF)], &[2], 3).unwrap();
        assert_eq!(lone.topology.leaf_triangles(), [2]);
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        let broken = |at: usize, link| {
            let mut nodes = three();
            nodes[at][3] = link;
            read(&nodes, &[7, 8, 9], 10).unwrap_err()
        };
        assert_eq!(broken(2, 4), BrokenTree::Child(4));
        let twice = BrokenTree::Record(RecordError::TriangleTwice {
            triangle: 8,
            first: 0,
            second: 1,
        });
        assert_eq!(broken(3, LEAF | 1), twice);
        assert_eq!(broken(3, 1), BrokenTree::Endless);
        assert_eq!(broken(3, LEAF | 3), BrokenTree::Leaf(3));
        assert!(matches!(broken(2, LEAF), BrokenTree::Record(_)));
    }
}
