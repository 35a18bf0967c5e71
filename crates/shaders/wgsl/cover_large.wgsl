//! use params root ieee eye extremes {intersector.packets} {treelets.adopt} cover places outline tiles keep_tile
// Likewise, of triangles that were too large for one invocation: each is shared by as many workgroups as there are for it.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> covers: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;

// Pixels that a workgroup's tiles span, along both axes of the picture.
const STRIDE: vec2<i32> = vec2<i32>(128, 32);

// Tiles of a large triangle that one of those who share it makes.
fn stamp_share(leaf: u32, local: u32, first: i32, sharers: i32) {
    let origin = eye();
    let o = outline_of(leaf, origin, root_from(origin).reach);
    let parts = (o.last - o.first + STRIDE) / STRIDE;
    for (var k = first; k < parts.x * parts.y; k += sharers) {
        let corner = o.first + STRIDE * vec2<i32>(k % parts.x, k / parts.x) + vec2<i32>(8 * i32(local & 15u), 4 * i32(local >> 4u));
        var pixels = 0u;
        if all(corner <= o.last) { pixels = loose_stamp(o, corner); }
        let place = place_stamps(min(pixels, 1u), countOneBits(pixels), local);
        // Then nobody need go on.
        if place.first > params.notes { break; }
        if pixels != 0u && place.own < params.notes { keep_tile(place.own, leaf, corner, pixels); }
    }
}

@compute @workgroup_size(128)
fn cover_large(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = atomicLoad(&counts[LARGE_COUNT]);
    if count == 0u || count > LISTED { return; }
    let sharers = max(groups.x / count, 1u);
    let abreast = groups.x / sharers;
    for (var k = group.x / sharers; k < count; k += abreast) {
        stamp_share(covers[k].x, local, i32(group.x % sharers), i32(sharers));
    }
}
