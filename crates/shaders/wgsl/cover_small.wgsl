//! use params root ieee eye extremes {intersector.packets} {treelets.adopt} cover places outline tiles keep_tile
// Which pixels each triangle may cover, in tiles: see "Rasterization" in ARCHITECTURE.md.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> covers: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;

// How many tiles of a triangle one invocation makes, at most.
const MOST: i32 = 32;

// How many tiles an outline takes, and about how many tests; the pixels of a single one, which is kept only if it has any.
struct Own { tiles: u32, tests: u32, pixels: u32 }

const NONE: Own = Own(0u, 0u, 0u);

// Of an outline that takes too many, none, but it is listed.
fn own_of(o: Outline, leaf: u32) -> Own {
    if any(o.first > o.last) { return NONE; }
    let size = o.last - o.first + 1;
    let blocks = (size + SIDES - 1) / SIDES;
    if all(blocks == vec2<i32>(1)) {
        let pixels = loose_stamp(o, o.first);
        return Own(min(pixels, 1u), countOneBits(pixels), pixels);
    }
    if blocks.x * blocks.y <= MOST { return Own(u32(blocks.x * blocks.y), u32(o.covered), 0u); }
    let place = atomicAdd(&counts[LARGE_COUNT], 1u);
    if place < LISTED { covers[place].x = leaf; }
    return NONE;
}

fn keep_several(o: Outline, leaf: u32, first: u32) {
    var at = first;
    for (var y = o.first.y; y <= o.last.y; y += SIDES.y) {
        for (var x = o.first.x; x <= o.last.x; x += SIDES.x) {
            keep_tile(at, leaf, vec2<i32>(x, y), loose_stamp(o, vec2<i32>(x, y)));
            at += 1u;
        }
    }
}

@compute @workgroup_size(256)
fn cover_small(@builtin(local_invocation_index) local: u32, @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let leaf = element(id, groups, 256u);
    let origin = eye();
    var o = without_edges(vec2<i32>(0), vec2<i32>(-1));
    if leaf < params.count { o = outline_of(leaf, origin, root_from(origin).reach); }
    let own = own_of(o, leaf);
    let at = place_stamps(own.tiles, own.tests, local).own;
    if own.tiles == 0u || at + own.tiles > params.notes { return; }
    if own.tiles == 1u { keep_tile(at, leaf, o.first, own.pixels); } else { keep_several(o, leaf, at); }
}
