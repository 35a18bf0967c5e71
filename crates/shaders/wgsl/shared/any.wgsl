// Whether a ray meets anything but one triangle: the first hit ends the search.

fn find_any(ray: Prepared, ignore: u32) -> bool {
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    if !meets_box(ray, nodes[0], nodes[1], ray.t_max) { return false; }
    loop {
        for (var i = 0u; i < 2u && (at & LEAF) == 0u; i += 1u) {
            let row = children_of(at);
            let l0 = nodes[row];
            let r0 = nodes[row + 2u];
            let meets_l = meets_box(ray, l0, nodes[row + 1u], ray.t_max);
            let meets_r = meets_box(ray, r0, nodes[row + 3u], ray.t_max);
            if meets_l && meets_r {
                stack[depth] = r0.w;
                depth += 1u;
            }
            at = select(select(NONE, r0.w, meets_r), l0.w, meets_l);
        }
        if (at & LEAF) != 0u {
            if at != NONE {
                if see_any(ray, first_of(at), ignore) { return true; }
                at = others_of(at);
            }
            if at == NONE {
                if depth == 0u { break; }
                depth -= 1u;
                at = stack[depth];
            }
        }
    }
    return false;
}
