//! use params loops ieee rest divide exact units root ray {intersector.test} {intersector.tiles} {treelets.adopt} camera eye seen stamps
// Which triangle each pixel's ray hits first, stamp by stamp: see "Rasters" in ARCHITECTURE.md.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> covers: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
// For each pixel t of the first hit as bits, above the index of its triangle; all ones where there is none. One more tells whether
// rasters have told all: all ones if so.
@group(0) @binding(5) var<storage, read_write> visibility: array<atomic<u64>>;

// Stamps that a workgroup takes at once, one an invocation; and their pixels: which stamp, above which of its pixels.
var<workgroup> taken: array<vec2<u32>, 64>;
var<workgroup> candidates: array<u32, 2048>;
var<workgroup> candidate_count: atomic<u32>;
// How many stamps there are; none if each ray is to go down the tree.
var<workgroup> stamp_count: u32;

// Keeps what a pixel's ray hits, if it is the least by t, then by index.
fn try_pixel(leaf: u32, pixel: vec2<u32>, root: Root) {
    let ray = camera_ray(through_pixel(pixel), eye(), root);
    let corners = turned_corners(ray, leaf);
    let e = edges_of(ray, corners);
    if surely_passes(e) { return; }
    let t = distance_to(ray, corners, e);
    if !(t > ray.t_min && t < ray.t_max) { return; }
    let key = (u64(bitcast<u32>(t)) << 32u) | u64(corners.triangle);
    atomicMin(&visibility[pixel.y * params.width + pixel.x], key);
}

fn take(stamp: u32, local: u32) {
    if stamp >= stamp_count { return; }
    let s = covers[LISTED + stamp];
    taken[local] = s.xy;
    var left = s.z;
    if left == 0u { return; }
    var at = atomicAdd(&candidate_count, countOneBits(left));
    while left != 0u {
        candidates[at] = (local << 5u) | firstTrailingBit(left);
        left &= left - 1u;
        at += 1u;
    }
}

fn try_candidate(candidate: u32, root: Root) {
    let s = taken[candidate >> 5u];
    let pixel = vec2<u32>(candidate & 7u, (candidate >> 3u) & 3u);
    try_pixel(s.x, vec2<u32>(s.y & 0xffffu, s.y >> 16u) + pixel, root);
}

// Whether all stamps were kept, and their pixels are so few that to test them takes less than to go down the tree.
fn tell_all(stamps: u32, pixels: u32) -> bool {
    return stamps <= params.notes && atomicLoad(&counts[LARGE_COUNT]) <= LISTED && atomicLoad(&counts[STAMPED_COUNT]) <= 2u * pixels;
}

// The same for all of a workgroup.
fn count_stamps(local: u32, group: u32) -> u32 {
    if local == 0u {
        let stamps = atomicLoad(&counts[STAMP_COUNT]);
        let pixels = params.width * params.height;
        let tells = tell_all(stamps, pixels);
        stamp_count = select(0u, stamps, tells);
        if !tells && group == 0u {
            atomicStore(&counts[UNTOLD], 1u);
            atomicMin(&visibility[pixels], u64(0u));
        }
    }
    return workgroupUniformLoad(&stamp_count);
}

@compute @workgroup_size(64)
fn rasterize(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = count_stamps(local, group.x);
    let root = root_from(eye());
    for (var first = 64u * group.x; first < count; first += 64u * groups.x) {
        if local == 0u { atomicStore(&candidate_count, 0u); }
        workgroupBarrier();
        take(first + local, local);
        workgroupBarrier();
        let number = atomicLoad(&candidate_count);
        for (var k = local; k < number; k += 64u) { try_candidate(candidates[k], root); }
        workgroupBarrier();
    }
}
