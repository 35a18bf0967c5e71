// Whether a ray meets anything but one triangle: the first hit ends the search.

// Goes a node down; if both children are met, the second waits.
fn push_children(ray: Prepared, at: u32, stack: ptr<function, array<u32, 64>>, depth: ptr<function, u32>) -> u32 {
    let row = children_of(at);
    let l0 = nodes[row];
    let r0 = nodes[row + 2u];
    let l = slab_interval(ray, l0, nodes[row + 1u], ray.t_max);
    let r = slab_interval(ray, r0, nodes[row + 3u], ray.t_max);
    let meets_l = l.x <= l.y;
    let meets_r = r.x <= r.y;
    if meets_l && meets_r {
        (*stack)[*depth] = r0.w;
        *depth += 1u;
    }
    return select(select(NONE, r0.w, meets_r), l0.w, meets_l);
}

fn find_any(ray: Prepared, ignore: u32) -> bool {
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    let root = slab_interval(ray, nodes[0], nodes[1], ray.t_max);
    if !(root.x <= root.y) { return false; }
    loop {
        if (at & LEAF) == 0u {
            at = push_children(ray, at, &stack, &depth);
            if (at & LEAF) == 0u {
                at = push_children(ray, at, &stack, &depth);
                if BY_PAIRS && (at & LEAF) == 0u { at = push_children(ray, at, &stack, &depth); }
            }
        }
        if (at & LEAF) != 0u {
            if at != NONE {
                if intersect_leaf_any(ray, first_of(at), ignore) { return true; }
                at = others_of(at);
                if BY_PAIRS && at != NONE {
                    if intersect_leaf_any(ray, first_of(at), ignore) { return true; }
                }
            }
            if BY_PAIRS || at == NONE {
                if depth == 0u { break; }
                depth -= 1u;
                at = stack[depth];
            }
        }
    }
    return false;
}
