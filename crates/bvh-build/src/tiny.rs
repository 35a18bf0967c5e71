//! Subtrees of one to four triangles: the best of all shapes.

use crate::MAX_DEPTH;
use crate::prim::{Bounds, Prim, Ruler};

/// The most triangles of a subtree built here.
pub(crate) const MOST: usize = 4;

/// Builds a subtree of 1 to [`MOST`] triangles whose root has the given depth.
pub(crate) fn build(prims: &[Prim], left_leaves: &mut [u32], order: &mut [u32], depth: u32) {
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
            let (shape, leaves) = quartet([a, b, c, d], depth + 3 <= MAX_DEPTH);
            left_leaves.copy_from_slice(&shape);
            write(order, leaves);
        }
        _ => unreachable!("a tiny subtree has one to four triangles"),
    }
}

fn write<const N: usize>(order: &mut [u32], leaves: [&Prim; N]) {
    for (to, prim) in order.iter_mut().zip(leaves) {
        *to = prim.triangle();
    }
}

fn pair(a: &Prim, b: &Prim) -> Bounds {
    Bounds {
        lo: a.lo.min(b.lo),
        hi: a.hi.max(b.hi),
    }
}

/// The pair of least area first.
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

/// The shape of least total area, among two pairs or (if `chain`) a trio and a single.
fn quartet([a, b, c, d]: [&Prim; 4], chain: bool) -> ([u32; 3], [&Prim; 4]) {
    // Opposite pairs stand at the same place.
    let near = [pair(a, b), pair(a, c), pair(a, d)];
    let far = [pair(c, d), pair(b, d), pair(b, c)];
    let ruler = Ruler::new(&near[0].union(far[0]));
    let (near_areas, far_areas) = (ruler.half_areas(&near), ruler.half_areas(&far));
    let both = near_areas + far_areas;
    let pairs = [[a, b, c, d], [a, c, b, d], [a, d, b, c]];
    let mut best = (both.x, [2, 1, 1], pairs[0]);
    for (i, leaves) in pairs.into_iter().enumerate().skip(1) {
        if both[i] < best.0 {
            best = (both[i], [2, 1, 1], leaves);
        }
    }
    if !chain {
        return (best.1, best.2);
    }
    // The three pairs of each trio, and who is left out.
    let trios = [
        ([near_areas.x, near_areas.y, far_areas.z], [a, b, c], d),
        ([near_areas.x, near_areas.z, far_areas.y], [a, b, d], c),
        ([near_areas.y, near_areas.z, far_areas.x], [a, c, d], b),
        ([far_areas.z, far_areas.y, far_areas.x], [b, c, d], a),
    ];
    for ([ab, ac, bc], [a, b, c], left_out) in trios {
        let trio = ruler.half_area(&Bounds {
            lo: a.lo.min(b.lo).min(c.lo),
            hi: a.hi.max(b.hi).max(c.hi),
        });
        if trio + ab.min(ac).min(bc) >= best.0 {
            continue;
        }
        let leaves = if ab <= ac && ab <= bc {
            [a, b, c, left_out]
        } else if ac <= bc {
            [a, c, b, left_out]
        } else {
            [b, c, a, left_out]
        };
        best = (trio + ab.min(ac).min(bc), [3, 2, 1], leaves);
    }
    (best.1, best.2)
}
