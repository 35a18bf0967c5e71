//! use params ieee rest divide units box_of_group point corner
// A place on a space-filling curve for each live triangle: its key, to sort by.
//
// The curve halves whichever side of the cell is the longest (Vinkler, Bittner,
// Havran: Extended Morton Codes for High Performance Bounding Volume Hierarchy
// Construction, 2017), so that flat scenes waste no bits. Each bit is one halving.

@group(0) @binding(1) var<storage, read> positions: array<u32>;
@group(0) @binding(2) var<storage, read> triangles: array<u32>;
// The triangles that the tree holds.
@group(0) @binding(3) var<storage, read> live: array<u32>;
@group(0) @binding(4) var<storage, read> boxes: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> keys: array<u32>;
@group(0) @binding(6) var<storage, read_write> sorted: array<u32>;

// `at` lies within the cell from 0 to `cell`.
fn key_of(at: vec3<f32>, cell: vec3<f32>) -> u32 {
    var rest = at;
    var size = cell;
    var key = 0u;
    for (var i = 0u; i < 32u; i += 1u) {
        let x = size.x >= size.y && size.x >= size.z;
        let y = !x && size.y >= size.z;
        let axis = vec3<bool>(x, y, !x && !y);
        size = select(size, 0.5 * size, axis);
        let upper = axis & (rest >= size);
        rest = select(rest, rest - size, upper);
        key = (key << 1u) | select(0u, 1u, any(upper));
    }
    return key;
}

// Triangles with a vertex that is not finite come last.
fn key_of_triangle(triangle: u32) -> u32 {
    let given = array<vec3<u32>, 3>(corner(triangle, 0u), corner(triangle, 1u), corner(triangle, 2u));
    let a = scaled_point(given[0]);
    let b = scaled_point(given[1]);
    let c = scaled_point(given[2]);
    if !(is_finite_point(a) && is_finite_point(b) && is_finite_point(c)) { return 0xffffffffu; }
    let center = 0.5 * min(min(a, b), c) + 0.5 * max(max(a, b), c);
    return key_of(center - lows[0], highs[0] - lows[0]);
}

@compute @workgroup_size(256)
fn morton(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // Each part twice: 128 parts, 256 invocations.
    let part = local & 127u;
    gather_box(local, boxes[2u * part].xyz, boxes[2u * part + 1u].xyz);
    let i = element(id, groups, 256u);
    if i >= params.count { return; }
    let triangle = live[i];
    keys[i] = key_of_triangle(triangle);
    sorted[i] = triangle;
}
