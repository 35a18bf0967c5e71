//! use params ieee rest divide units degenerate flat standing point corner {record.write}
// Positions to triangle records and boxes of leaves, in the tree's leaf order; of all leaves or of those that move.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read> leaf_nodes: array<u32>;
@group(0) @binding(3) var<storage, read> triangles: array<u32>;
@group(0) @binding(4) var<storage, read> positions: array<u32>;
@group(0) @binding(5) var<storage, read_write> records: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> nodes: array<vec4<u32>>;
// Inactive and degenerate leaves.
@group(0) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;

const LEAF: u32 = 0x80000000u;

@compute @workgroup_size(128)
fn preprocess(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    var leaf = element(id, groups, 128u);
    if leaf >= params.count { return; }
    if params.listed == 1u { leaf = topology[params.first + leaf]; }
    let triangle = topology[params.leaf_triangles_at + leaf];
    let node = leaf_nodes[leaf];
    let given_a = corner(triangle, 0u);
    let given_b = corner(triangle, 1u);
    let given_c = corner(triangle, 2u);
    let a = scaled_point(given_a);
    let b = scaled_point(given_b);
    let c = scaled_point(given_c);
    let record = record_of(triangle, a, b, c);
    keep_index(leaf, triangle);
    records[3u * leaf] = record.first;
    records[3u * leaf + 1u] = record.second;
    records[3u * leaf + 2u] = record.third;

    let stands = standing(given_a, given_b, given_c, a, b, c);
    var low = vec3<u32>(0x7f800000u);
    var high = vec3<u32>(0xff800000u);
    if stands == SOUND {
        low = bitcast<vec3<u32>>(min(min(a, b), c));
        high = bitcast<vec3<u32>>(max(max(a, b), c));
    } else if stands == DEGENERATE {
        atomicAdd(&counts[1], 1u);
    } else {
        atomicAdd(&counts[0], 1u);
    }
    nodes[2u * node] = vec4<u32>(low, LEAF | leaf);
    nodes[2u * node + 1u] = vec4<u32>(high, 0u);
}
