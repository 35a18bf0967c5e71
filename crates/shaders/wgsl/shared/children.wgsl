// Boxes of an inner node's children. Who uses it declares `nodes`.

// Flags an inner node with a moving leaf below, in `inner_nodes`.
const MOVES: u32 = 0x80000000u;

struct Children {
    left_low: vec4<u32>,
    left_high: vec4<u32>,
    right_low: vec4<u32>,
    right_high: vec4<u32>,
}

fn children(inner: u32) -> Children {
    let at = 2u * (2u * inner + 1u);
    return Children(nodes[at], nodes[at + 1u], nodes[at + 2u], nodes[at + 3u]);
}

fn areas(pair: Children) -> f32 {
    return half_area(pair.left_low, pair.left_high) + half_area(pair.right_low, pair.right_high);
}
