//! use params ieee divide units degenerate flat standing {record.write} {treelets.refit}
// Positions to triangle records, boxes of leaves, and boxes of all nodes within treelets of triangles;
// of all those treelets or of those that move.
//
// A workgroup a treelet, an invocation a triangle. Stores go through the workgroup's memory, so that
// neighbours write neighbouring rows. Areas are added up as `refit` does, one partial sum a treelet.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
// Three vertices a triangle, in leaf order: see gather_corners.wgsl.
@group(0) @binding(2) var<storage, read> leaf_corners: array<u32>;
@group(0) @binding(3) var<storage, read> positions: array<u32>;
@group(0) @binding(4) var<storage, read_write> records: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> costs: array<f32>;
// Inactive and degenerate leaves.
@group(0) @binding(7) var<storage, read_write> counts: array<atomic<u32>>;

const LEAF: u32 = 0x80000000u;
const TWO: u32 = 0x40000000u;
const SHARED: u32 = 0x80000000u;
const EMPTY_LOW: u32 = 0x7f800000u;
const EMPTY_HIGH: u32 = 0xff800000u;
// Words from one word of a staged record to the next: rows are then read from different banks.
const STRIDE: u32 = 267u;

struct Box { low: vec3<u32>, high: vec3<u32> }

fn stage(local: u32, which: u32, row: vec4<u32>) {
    let at = 4u * which * STRIDE + local;
    kept[at] = row.x;
    kept[at + STRIDE] = row.y;
    kept[at + 2u * STRIDE] = row.z;
    kept[at + 3u * STRIDE] = row.w;
}

fn write_records(t: Treelet, local: u32) {
    for (var row = local; row < 3u * t.leaf_count; row += GROUP) {
        let at = 4u * (row % 3u) * STRIDE + row / 3u;
        records[3u * t.first_leaf + row] =
            vec4<u32>(kept[at], kept[at + STRIDE], kept[at + 2u * STRIDE], kept[at + 3u * STRIDE]);
    }
}

fn corner(leaf: u32, which: u32) -> vec3<u32> {
    let at = 3u * leaf_corners[3u * leaf + which];
    return vec3<u32>(positions[at], positions[at + 1u], positions[at + 2u]);
}

// Stages a triangle's record and returns its box.
fn stand(local: u32, leaf: u32, triangle: u32) -> Box {
    let given_a = corner(leaf, 0u);
    let given_b = corner(leaf, 1u);
    let given_c = corner(leaf, 2u);
    let a = scaled_point(given_a);
    let b = scaled_point(given_b);
    let c = scaled_point(given_c);
    let record = record_of(triangle, 0u, a, b, c);
    stage(local, 0u, record.first);
    stage(local, 1u, record.second);
    stage(local, 2u, record.third);
    let how = standing(given_a, given_b, given_c, a, b, c);
    if how != SOUND {
        atomicAdd(&counts[select(0u, 1u, how == DEGENERATE)], 1u);
        return Box(vec3<u32>(EMPTY_LOW), vec3<u32>(EMPTY_HIGH));
    }
    return Box(bitcast<vec3<u32>>(min(min(a, b), c)), bitcast<vec3<u32>>(max(max(a, b), c)));
}

// Joins a triangle's leaf with the next one's; traversal is told of those alone that a ray can hit.
fn share(local: u32, leaf: u32) -> f32 {
    let first = LEAVES + local;
    if kept[first] == EMPTY_LOW {
        keep_leaf(local, select(LEAF | (leaf + 1u), LEAF | leaf, kept[first + 1u] == EMPTY_LOW));
    } else if kept[first + 1u] != EMPTY_LOW {
        keep_leaf(local, LEAF | TWO | leaf);
    }
    return join(first, first, first + 1u);
}

@compute @workgroup_size(256)
fn preprocess_treelets(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let place = group.x + group.y * groups.x;
    if place >= params.count { return; }
    let number = treelet_at(place);
    let t = treelet(number);
    var word = 0u;
    var own: Box;
    let leaf = t.first_leaf + local;
    let inner = inner_word(t, local);
    if local < t.leaf_count {
        word = topology[params.leaf_triangles_at + leaf];
        keep_index(leaf, word & ~SHARED);
        own = stand(local, leaf, word & ~SHARED);
    }
    workgroupBarrier();
    write_records(t, local);
    workgroupBarrier();
    if local < t.leaf_count {
        keep_box(LEAVES + local, own.low, own.high);
        keep_leaf(local, LEAF | leaf);
    }
    workgroupBarrier();
    var area = 0.0;
    if (word & SHARED) != 0u { area = share(local, leaf); }
    workgroupBarrier();
    area += refit_treelet(t, local, inner);
    write_treelet(t, local);
    let sum = sum_of_group(local, area);
    if local == 0u { costs[number] = sum; }
}
