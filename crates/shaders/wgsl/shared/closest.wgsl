// Closest hit; the intersector says what it keeps of the leaves it sees.

// Goes a node down; if both children are met, the farther waits.
fn traverse_node(ray: Prepared, at: u32, best: f32, stack: ptr<function, array<u32, 64>>, depth: ptr<function, u32>) -> u32 {
    let row = children_of(at);
    let l0 = nodes[row];
    let r0 = nodes[row + 2u];
    let l = slab_interval(ray, l0, nodes[row + 1u], best);
    let r = slab_interval(ray, r0, nodes[row + 3u], best);
    let meets_l = l.x <= l.y;
    let meets_r = r.x <= r.y;
    if meets_l && meets_r {
        let right_first = r.x < l.x;
        (*stack)[*depth] = select(r0.w, l0.w, right_first);
        *depth += 1u;
        return select(l0.w, r0.w, right_first);
    }
    return select(select(NONE, r0.w, meets_r), l0.w, meets_l);
}

// One loop, each turn of which takes two nodes and a triangle at most. Turns of one kind of work
// each (Aila, Laine 2009: "if-if") were a tenth slower, and descending to a leaf slower still.
fn find_closest(ray: Prepared) -> Found {
    var best = nothing_found(ray);
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    let root = slab_interval(ray, nodes[0], nodes[1], limit(best));
    if !(root.x <= root.y) { return best; }
    loop {
        if (at & LEAF) == 0u {
            at = traverse_node(ray, at, limit(best), &stack, &depth);
            if (at & LEAF) == 0u { at = traverse_node(ray, at, limit(best), &stack, &depth); }
        }
        if (at & LEAF) != 0u {
            if at != NONE {
                best = intersect_leaf_closest(ray, first_of(at), best);
                at = others_of(at);
            }
            if at == NONE {
                if depth == 0u { break; }
                depth -= 1u;
                at = stack[depth];
            }
        }
    }
    return best;
}
