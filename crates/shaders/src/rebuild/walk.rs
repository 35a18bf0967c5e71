//! A device's tree read back as a record.

use bvh_layout::Topology;

const LEAF: u32 = 1 << 31;
const TWO: u32 = 1 << 30;
const ENDLESS: &str = "the device's tree goes on without end";

fn no_child(node: u32) -> String {
    format!("the device's tree has a child at node {node}")
}

/// The record of a tree that the device made, and where each of its nodes lies among the device's; over leaves of these
/// `triangles`, in a scene of so many.
/// `links` are its nodes' by their places with layout `bvh2` (see build/cluster.wgsl): the left child's place, or a leaf.
///
/// # Errors
/// The nodes make no tree over all the leaves.
pub(crate) fn read(
    links: &[u32],
    triangles: &[u32],
    scene_triangles: u32,
) -> Result<(Topology, Vec<u32>), String> {
    let (places, inner, levels) = order(links)?;
    let is_inner = |i: &usize| inner.binary_search(i).is_ok();
    let leaves: Vec<usize> = (0..places.len()).filter(|i| !is_inner(i)).collect();
    let mut named = Vec::with_capacity(leaves.len());
    for &i in &leaves {
        let leaf = links[places[i] as usize] & !LEAF;
        let triangle = triangles.get(leaf as usize);
        named.push(*triangle.ok_or_else(|| format!("the device's tree has a leaf {leaf}"))?);
    }
    let counts = [scene_triangles, triangles.len() as u32];
    let words = words(&levels, &leaves, &named, counts);
    let topology = Topology::from_words(words);
    let topology = topology.map_err(|e| format!("the device's tree makes no record: {e}"))?;
    Ok((topology, places))
}

/// Links as [`read`] takes them, in breadth-first order, of the `rows` of layout `fast` over so many leaves.
///
/// # Errors
/// A row lies beyond all, or more nodes hang together than there are.
pub(crate) fn links_of_rows(rows: &[[u32; 4]], leaves: usize) -> Result<Vec<u32>, String> {
    let mut names: Vec<u32> = rows.iter().take(1).map(|row| row[3]).collect();
    names.truncate(leaves);
    let mut links = Vec::with_capacity(2 * leaves);
    while let Some(&name) = names.get(links.len()) {
        let children = match (name & LEAF, name & TWO) {
            (0, _) => {
                let at = 4 * name as usize;
                let row = |i| rows.get(i).ok_or_else(|| no_child(name));
                Some([row(at)?[3], row(at + 2)?[3]])
            }
            (_, 0) => None,
            _ => Some([name & !TWO, (name & !TWO) + 1]),
        };
        links.push(children.map_or(name, |_| names.len() as u32));
        names.extend(children.into_iter().flatten());
        if names.len() > 2 * leaves {
            return Err(ENDLESS.into());
        }
    }
    Ok(links)
}

/// Where nodes lie on the device, level by level; which of them are inner nodes, and how many of each level are.
type Order = (Vec<u32>, Vec<usize>, Vec<u32>);

fn order(links: &[u32]) -> Result<Order, String> {
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
                    return Err(no_child(link));
                }
                inner.push(i);
                places.extend([link, link + 1]);
            }
        }
        if places.len() > links.len() {
            return Err(ENDLESS.into());
        }
        levels.push((inner.len() - before) as u32);
        begin = end;
    }
    Ok((places, inner, levels))
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
    let mut words = vec![Topology::MAGIC, Topology::VERSION, scene, count];
    words.extend([levels.len() as u32, 0, 0, 0]);
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
        assert_eq!(of(&[1, 0, two, 3, LEAF, 0], 4), Err(no_child(3)));
        assert_eq!(of(&[1, 0, two, 1, LEAF, 0], 4), Err(ENDLESS.into()));
    }

    #[test]
    fn what_is_no_tree_is_refused() {
        let broken = |at: usize, link| {
            let mut nodes = three();
            nodes[at] = link;
            read(&nodes, &[7, 8, 9], 10).unwrap_err()
        };
        assert_eq!(broken(2, 4), no_child(4));
        assert_eq!(broken(3, 1), ENDLESS);
        assert!(broken(3, LEAF | 3).ends_with("a leaf 3"));
        // A triangle twice, and one that is missing.
        for (at, link) in [(3, LEAF | 1), (2, LEAF)] {
            assert!(broken(at, link).contains("makes no record: "));
        }
    }
}
