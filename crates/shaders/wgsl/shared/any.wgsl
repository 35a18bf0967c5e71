// Whether a ray meets anything but one triangle: the first hit ends the search. Each turn goes two nodes down at most and tests one
// triangle.

fn find_any(ray: Prepared, ignore: u32) -> bool {
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    let root = stretch(ray, nodes[0], nodes[1], ray.t_max);
    if !(root.x <= root.y) { return false; }
    loop {
        if (at & LEAF) == 0u {
            at = go_on(ray, at, &stack, &depth);
            if (at & LEAF) == 0u { at = go_on(ray, at, &stack, &depth); }
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
