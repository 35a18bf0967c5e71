//! Builds subtrees of one to four triangles. Compares all shapes and takes the best.

use crate::MAX_DEPTH;
use crate::prim::{Prim, PrimBounds, Ruler};
use crate::tree::SubtreeSlot;

/// Maximum number of triangles of a subtree built here.
pub(crate) const MOST: usize = 4;

/// Builds a subtree of 1 to [`MOST`] triangles whose root has the given depth.
pub(crate) fn build(prims: &[Prim], slot: SubtreeSlot<'_>, depth: u32) {
    let SubtreeSlot { left_leaves, order } = slot;
    match prims {
        [a] => order[0] = a.triangle(),
        [a, b] => {
            left_leaves[0] = 1;
            write(order, [a, b]);
        }
        [a, b, c] => {
            left_leaves.copy_from_slice(&[2, 1]);
            write(order, trio([a, b, c]));
        }
        [a, b, c, d] => {
            let best = quartet([a, b, c, d], depth + 3 <= MAX_DEPTH);
            left_leaves.copy_from_slice(&best.left_leaves);
            write(order, best.order);
        }
        _ => unreachable!("a tiny subtree has one to four triangles"),
    }
}

fn write<const N: usize>(order: &mut [u32], leaves: [&Prim; N]) {
    for (to, prim) in order.iter_mut().zip(leaves) {
        *to = prim.triangle();
    }
}

fn pair(a: &Prim, b: &Prim) -> PrimBounds {
    a.bounds.union(b.bounds)
}

/// Orders three boxes so that the pair of least area comes first.
fn trio([a, b, c]: [&Prim; 3]) -> [&Prim; 3] {
    let pairs = [pair(a, b), pair(b, c), pair(a, c)];
    let areas = Ruler::new(&pairs[0].union(pairs[1])).half_areas(&pairs);
    if areas.x <= areas.y && areas.x <= areas.z {
        [a, b, c]
    } else if areas.y <= areas.z {
        [b, c, a]
    } else {
        [a, c, b]
    }
}

/// A tree of four leaves.
struct Quartet<'a> {
    left_leaves: [u32; 3],
    order: [&'a Prim; 4],
}

/// Returns the shape of least total area with its leaves: two pairs or, if `chain` is set, a trio and a single.
fn quartet([a, b, c, d]: [&Prim; 4], chain: bool) -> Quartet<'_> {
    // All six pairs: `near` has the pairs that contain `a`. `far[i]` is the pair of the two boxes that `near[i]`
    // lacks.
    let near = [pair(a, b), pair(a, c), pair(a, d)];
    let far = [pair(c, d), pair(b, d), pair(b, c)];
    let ruler = Ruler::new(&near[0].union(far[0]));
    let [near, far] = [near, far].map(|pairs| ruler.half_areas(&pairs));
    let costs = near + far;
    let (cost, leaves) = if costs.x <= costs.y && costs.x <= costs.z {
        (costs.x, [a, b, c, d])
    } else if costs.y <= costs.z {
        (costs.y, [a, c, b, d])
    } else {
        (costs.z, [a, d, b, c])
    };
    let pairs = Quartet {
        left_leaves: [2, 1, 1],
        order: leaves,
    };
    if !chain {
        return pairs;
    }
    // For each trio: the areas of its three pairs, and the order of leaves with the single one last.
    let chains = [
        ([near.x, near.y, far.z], [a, b, c, d]),
        ([near.x, near.z, far.y], [a, b, d, c]),
        ([near.y, near.z, far.x], [a, c, d, b]),
        ([far.z, far.y, far.x], [b, c, d, a]),
    ];
    let [first, others @ ..] = chains.map(|([ab, ac, bc], [a, b, c, d])| {
        let trio = ruler.half_area(&pair(a, b).union(c.bounds));
        if ab <= ac && ab <= bc {
            (trio + ab, [a, b, c, d])
        } else if ac <= bc {
            (trio + ac, [a, c, b, d])
        } else {
            (trio + bc, [b, c, a, d])
        }
    });
    let lesser = |a: (f32, _), b: (f32, _)| if b.0 < a.0 { b } else { a };
    let (chain_cost, chained) = others.into_iter().fold(first, lesser);
    if chain_cost < cost {
        Quartet {
            left_leaves: [3, 2, 1],
            order: chained,
        }
    } else {
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BinaryTree;
    use crate::builder::tests::sized;
    use geom::Aabb;

    fn prims(seed: u64) -> [Prim; 4] {
        let mut random = fastrand::Rng::with_seed(seed);
        std::array::from_fn(|i| {
            let [min, edges] = [[0; 3]; 2].map(|of| of.map(|_| random.f32()));
            Prim::new(&sized(min, edges), i as u32)
        })
    }

    /// Returns the total area of all inner nodes below the root.
    fn cost(prims: &[Prim; 4], shape: [u32; 3], leaves: &[u32]) -> f64 {
        let area = |of: &[u32]| {
            let boxes = of.iter().map(|&i| prims[i as usize].bounds.aabb());
            boxes.fold(Aabb::EMPTY, Aabb::union).half_area()
        };
        match shape {
            [2, 1, 1] => area(&leaves[..2]) + area(&leaves[2..]),
            [3, 2, 1] => area(&leaves[..3]) + area(&leaves[..2]),
            _ => panic!("no shape of four leaves: {shape:?}"),
        }
    }

    fn all_orders() -> impl Iterator<Item = [u32; 4]> {
        (0..256_u32)
            .map(|code| [0, 2, 4, 6].map(|shift| code >> shift & 3))
            .filter(|o| (0..4).all(|i| o.contains(&i)))
    }

    #[test]
    fn four_triangles_use_the_best_shape() {
        let (mut shapes, mut tree) = ([0; 2], BinaryTree::default());
        for seed in 0..500 {
            let prims = prims(seed);
            for (depth, allowed) in [(61, &[[2, 1, 1], [3, 2, 1]][..]), (62, &[[2, 1, 1]])] {
                build(&prims, tree.slot(4), depth);
                let shape: [u32; 3] = tree.left_leaves[..].try_into().unwrap();
                assert!(allowed.contains(&shape), "depth {depth}: {shape:?}");
                let all = allowed
                    .iter()
                    .flat_map(|&s| all_orders().map(move |o| (s, o)));
                let costs = all.map(|(s, o)| cost(&prims, s, &o));
                let best = costs.fold(f64::MAX, f64::min);
                let found = cost(&prims, shape, &tree.order);
                assert!(found <= best * (1.0 + 1e-5), "seed {seed}: {found} {best}");
                shapes[usize::from(shape == [3, 2, 1])] += 1;
            }
        }
        assert!(shapes.iter().all(|&n| n > 50), "both occur: {shapes:?}");
    }

    #[test]
    fn three_triangles_pair_the_closest_two() {
        let at = |x: f32, i| Prim::new(&sized([x; 3], [1.0; 3]), i);
        for (order, far) in [
            ([0.0, 9.0, 1.0], 1),
            ([9.0, 0.0, 1.0], 0),
            ([0.0, 1.0, 9.0], 2),
        ] {
            let prims: Vec<_> = order.iter().zip(0..).map(|(&x, i)| at(x, i)).collect();
            let mut tree = BinaryTree::default();
            build(&prims, tree.slot(3), 0);
            assert_eq!((&tree.left_leaves[..], tree.order[2]), (&[2, 1][..], far));
        }
    }
}
