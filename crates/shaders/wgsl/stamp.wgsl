//! use params root ieee eye extremes {intersector.tiles} {treelets.adopt} cover places outline stamps keep_stamp
// Which pixels each triangle may cover, in stamps: see "Rasters" in ARCHITECTURE.md.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> covers: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;

// How many stamps of a triangle one invocation makes, at most.
const MOST: i32 = 32;

// How many stamps an outline takes; of one that takes too many, none, but it is listed.
fn stamps_of(o: Outline, leaf: u32) -> u32 {
    if any(o.first > o.last) { return 0u; }
    let blocks = (o.last - o.first + SIDES) / SIDES;
    if blocks.x * blocks.y <= MOST { return u32(blocks.x * blocks.y); }
    let place = atomicAdd(&counts[LARGE_COUNT], 1u);
    if place < LISTED { covers[place].x = leaf; }
    return 0u;
}

// Makes an outline's stamps, and says how many pixels they have.
fn stamp_small(o: Outline, leaf: u32, first: u32) -> u32 {
    var at = first;
    var sum = 0u;
    for (var y = o.first.y; y <= o.last.y; y += SIDES.y) {
        for (var x = o.first.x; x <= o.last.x; x += SIDES.x) {
            let pixels = loose_stamp(o, vec2<i32>(x, y));
            keep_stamp(at, leaf, vec2<i32>(x, y), pixels);
            sum += countOneBits(pixels);
            at += 1u;
        }
    }
    return sum;
}

@compute @workgroup_size(256)
fn stamp(@builtin(local_invocation_index) local: u32, @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let leaf = element(id, groups, 256u);
    let origin = eye();
    var o = without_edges(vec2<i32>(0), vec2<i32>(-1));
    if leaf < params.count { o = outline_of(leaf, origin, root_from(origin).reach); }
    let own = stamps_of(o, leaf);
    let at = place_stamps(own, local).own;
    var pixels = 0u;
    if own > 0u && at + own <= params.notes { pixels = stamp_small(o, leaf, at); }
    count_stamped(pixels, local);
}
