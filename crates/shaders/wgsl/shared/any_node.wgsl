// A node of the search for any hit.

// Goes a node down; if both children are met, the second waits.
fn go_on(ray: Prepared, at: u32, stack: ptr<function, array<u32, 64>>, depth: ptr<function, u32>) -> u32 {
    let row = children_of(at);
    let l0 = nodes[row];
    let r0 = nodes[row + 2u];
    let l = stretch(ray, l0, nodes[row + 1u], ray.t_max);
    let r = stretch(ray, r0, nodes[row + 3u], ray.t_max);
    let meets_l = l.x <= l.y;
    let meets_r = r.x <= r.y;
    if meets_l && meets_r {
        (*stack)[*depth] = r0.w;
        *depth += 1u;
    }
    return select(select(NONE, r0.w, meets_r), l0.w, meets_l);
}
