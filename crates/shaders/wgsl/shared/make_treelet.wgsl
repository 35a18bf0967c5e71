// A workgroup of 256 makes all of a treelet of triangles, an invocation a triangle. Areas are added up as `refit` does,
// one partial sum a treelet. How many workgroups a device has in flight depends on registers: what is not needed
// while corners are at hand is read later, and what is rarely needed, again.

@group(0) @binding(next) var<storage, read> topology: array<u32>;
// Three vertices a triangle, in leaf order: see gather_corners.wgsl.
@group(0) @binding(next) var<storage, read> leaf_corners: array<u32>;
@group(0) @binding(next) var<storage, read_write> records: array<vec4<u32>>;
@group(0) @binding(next) var<storage, read_write> nodes: array<vec4<u32>>;
// Inactive and degenerate leaves.
@group(0) @binding(next) var<storage, read_write> counts: array<atomic<u32>>;

const LEAF: u32 = 0x80000000u;
const TWO: u32 = 0x40000000u;
const SHARED: u32 = 0x80000000u;
const EMPTY_LOW: u32 = 0x7f800000u;
const EMPTY_HIGH: u32 = 0xff800000u;

fn vertices_of(leaf: u32) -> vec3<u32> {
    return vec3<u32>(leaf_corners[3u * leaf], leaf_corners[3u * leaf + 1u], leaf_corners[3u * leaf + 2u]);
}

// Whether a triangle that is not seen to have an area has none. The compiler must not know that its corners are at hand.
fn has_none(leaf: u32) -> bool {
    let given = corners_again(vertices_of(leaf + params.zero));
    return is_degenerate(given.a, given.b, given.c);
}

// Keeps an empty box for a triangle that no ray can hit, and counts it. Its record names no triangle: who comes to it by
// other ways than its box is warned.
fn keep_empty(local: u32, leaf: u32, count: u32) {
    atomicAdd(&counts[count], 1u);
    records[3u * leaf].w = 0xffffffffu;
    keep_box(LEAVES + local, vec3<u32>(EMPTY_LOW), vec3<u32>(EMPTY_HIGH));
}

// Writes a triangle's record and keeps its box; returns whether it may yet have no area.
fn stand(local: u32, leaf: u32, triangle: u32) -> bool {
    let given = corners_of(vertices_of(leaf));
    let a = scaled_point(given.a);
    let b = scaled_point(given.b);
    let c = scaled_point(given.c);
    let record = record_of(triangle, a, b, c);
    records[3u * leaf] = record.first;
    records[3u * leaf + 1u] = record.second;
    records[3u * leaf + 2u] = record.third;
    keep_leaf(local, LEAF | leaf);
    if !(is_finite(given.a) && is_finite(given.b) && is_finite(given.c)) {
        keep_empty(local, leaf, 0u);
        return false;
    }
    keep_box(LEAVES + local, bitcast<vec3<u32>>(min(min(a, b), c)), bitcast<vec3<u32>>(max(max(a, b), c)));
    return !seen_to_have_area(given.a, given.b, given.c, a, b, c);
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

// Every invocation must call it, in uniform control flow.
fn make_treelet(local: u32, place: u32) {
    let number = treelet_at(place);
    let leaf = topology[ENTRY * number] + local;
    let is_there = local < topology[ENTRY * number + 1u];
    let inner = inner_word(number, local);
    look_ahead(number);
    var word = 0u;
    if is_there {
        word = topology[params.leaf_triangles_at + leaf];
        keep_index(leaf, word & ~SHARED);
        if stand(local, leaf, word & ~SHARED) && has_none(leaf) { keep_empty(local, leaf, 1u); }
    }
    let t = treelet(number);
    workgroupBarrier();
    var area = 0.0;
    if (word & SHARED) != 0u { area = share(local, leaf); }
    workgroupBarrier();
    area += refit_treelet(t, inner);
    leave(number, local, area);
}
