//! A device's tree read back as a record.

use bvh_layout::{RecordError, Topology};

const LEAF: u32 = 1 << 31;
const TWO: u32 = 1 << 30;

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

/// The record of a tree that the device made, over leaves of these `triangles`, in a scene of so many.
/// `links` are its nodes' by their places with layout `bvh2` (see build/cluster.wgsl): the left child's place, or a leaf.
///
/// # Errors
/// The nodes make no tree over all the leaves.
pub(crate) fn read(
    links: &[u32],
    triangles: &[u32],
    scene_triangles: u32,
) -> Result<Found, BrokenTree> {
    let Order {
        places,
        inner,
        levels,
    } = order(links)?;
    let is_inner = |i: &usize| inner.binary_search(i).is_ok();
    let leaves: Vec<usize> = (0..places.len()).filter(|i| !is_inner(i)).collect();
    let mut named = Vec::with_capacity(leaves.len());
    for &i in &leaves {
        let leaf = links[places[i] as usize] & !LEAF;
        let triangle = triangles.get(leaf as usize);
        named.push(*triangle.ok_or(BrokenTree::Leaf(leaf))?);
    }
    let counts = [scene_triangles, triangles.len() as u32];
    let words = words(&levels, &leaves, &named, counts);
    let topology = Topology::from_words(words).map_err(BrokenTree::Record)?;
    Ok(Found { topology, places })
}

/// Links as [`read`] takes them, in breadth-first order, of the `rows` of layout `fast` over so many leaves.
///
/// # Errors
/// A row lies beyond all, or more nodes hang together than there are.
pub(crate) fn links_of_rows(rows: &[[u32; 4]], leaves: usize) -> Result<Vec<u32>, BrokenTree> {
    let mut names: Vec<u32> = rows.iter().take(1).map(|row| row[3]).collect();
    names.truncate(leaves);
    let mut links = Vec::with_capacity(2 * leaves);
    while let Some(&name) = names.get(links.len()) {
        let children = match (name & LEAF, name & TWO) {
            (0, _) => {
                let at = 4 * name as usize;
                let row = |i| rows.get(i).ok_or(BrokenTree::Child(name));
                Some([row(at)?[3], row(at + 2)?[3]])
            }
            (_, 0) => None,
            _ => Some([name & !TWO, (name & !TWO) + 1]),
        };
        links.push(children.map_or(name, |_| names.len() as u32));
        names.extend(children.into_iter().flatten());
        if names.len() > 2 * leaves {
            return Err(BrokenTree::Endless);
        }
    }
    Ok(links)
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

fn order(links: &[u32]) -> Result<Order, BrokenTree> {
    let mut places = Vec::with_capacity(links.len());
    let (mut inner, mut levels) = (Vec::new(), Vec::new());
    places.extend((!links.is_empty()).then_some(0));
    let mut begin = 0;
    while begin < places.len() {
        let (end, before) = (places.len(), inner.len());
        for i in begin..end {
            let link = links[places[i] as usize];
            if link & LEAF == 0 {
                if link as usize + 1 >= links.len() {
                    return Err(BrokenTree::Child(link));
                }
                inner.push(i);
                places.extend([link, link + 1]);
            }
        }
        if places.len() > links.len() {
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

    /// The root's left child is leaf 1, its right child holds leaves 0 and 2.
    fn three() -> Vec<u32> {
        vec![1, LEAF | 1, 3, LEAF, LEAF | 2]
    }

    /// Rows of layout `fast` with these words, each the first of two.
    fn rows(names: &[u32]) -> Vec<[u32; 4]> {
        let both = names.iter().map(|&name| [[0, 0, 0, name], [0; 4]]);
        both.flatten().collect()
    }

    #[test]
    fn rows_become_links_level_by_level() {
        let of = |names: &[u32], leaves| links_of_rows(&rows(names), leaves);
        // Inner node 1 is the root, 2 its right child, and its left one a leaf of two.
        let two = LEAF | TWO | 1;
        let names = [1, 0, two, 2, LEAF, LEAF | 3];
        let links = vec![1, 3, 5, LEAF | 1, LEAF | 2, LEAF, LEAF | 3];
        assert_eq!(of(&names, 4), Ok(links.clone()));
        assert!(read(&links, &[4, 5, 6, 7], 8).is_ok());
        assert_eq!(of(&[LEAF, 0], 1), Ok(vec![LEAF]));
        assert_eq!(of(&[0, 0], 0), Ok(vec![]));
        assert_eq!(of(&[1, 0, two, 3, LEAF, 0], 4), Err(BrokenTree::Child(3)));
        assert_eq!(of(&[1, 0, two, 1, LEAF, 0], 4), Err(BrokenTree::Endless));
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
        let lone = read(&[LEAF], &[2], 3).unwrap();
        assert_eq!(lone.topology.leaf_triangles(), [2]);
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        let broken = |at: usize, link| {
            let mut nodes = three();
            nodes[at] = link;
            read(&nodes, &[7, 8, 9], 10).unwrap_err()
        };
        assert_eq!(broken(2, 4), BrokenTree::Child(4));
        let twice = "the device's tree makes no record: leaves 0 and 1 both name triangle 8";
        assert_eq!(broken(3, LEAF | 1).to_string(), twice);
        assert_eq!(broken(3, 1), BrokenTree::Endless);
        assert_eq!(broken(3, LEAF | 3), BrokenTree::Leaf(3));
        assert!(matches!(broken(2, LEAF), BrokenTree::Record(_)));
    }
}
