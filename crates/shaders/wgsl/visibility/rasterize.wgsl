// Rasterization, second step: finds the triangle that each pixel's ray hits first, by atomic minima in the visibility buffer.

import package::geometry::queries::{camera_ray, eye, pixel_direction};
import package::geometry::ray::{RelativeRoot, root_relative_to};
@if(!WATERTIGHT)
import package::intersect::intersector::nearest_t;
import package::intersect::sheared::{edges_of, permuted_corners};
import package::intersect::watertight::{distance_to, surely_misses_triangle};
import package::lib::buffers::{counts, pixel_coverage};
import package::lib::counters::{LARGE_TRIANGLE_COUNT, RASTER_INCOMPLETE, TEST_COUNT, TILE_COUNT};
import package::lib::lanes::{count_at_most, group_inclusive_sum, group_shuffle};
import package::lib::params::{element_index, params};
import package::visibility::cover::{KEYS_PER_PIXEL, LARGE_CAPACITY};

// With `watertight`, one key per pixel: the bits of the first hit's t in the upper half, the index of its triangle in
// the lower half, or all ones if nothing is hit. The other intersectors store two keys per pixel: the least two
// results of `nearest_t`, each with its leaf. A last element is all ones if rasterization was complete.
@if(clear_visibility)
@group(0) @binding(next) var<storage, read_write> visibility: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read_write> visibility: array<atomic<u64>>;

// Clears the visibility buffer, two words of 64 bits per invocation: see docs/design/visibility-buffer.md.
@compute @workgroup_size(128)
fn clear_visibility(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i < params.count { visibility[i] = vec4<u32>(0xffffffffu); }
}

// First hits of pixels, tile by tile. 32 invocations load one tile each and share all tests evenly, so all 32 must call these
// functions together. See docs/design/visibility-buffer.md.

// Number of tiles; 0 if `resolve` has to trace every ray.
var<workgroup> tile_count: u32;

struct BitSearch { bits: u32, skip: u32, at: u32 }

// Continues in the lower half of the bits if more than `skip` bits are set there, else in the upper half.
fn search_half(search: BitSearch, half: u32) -> BitSearch {
    let lower = countOneBits(search.bits & ((1u << half) - 1u));
    if search.skip < lower { return search; }
    return BitSearch(search.bits >> half, search.skip - lower, search.at + half);
}

// Returns the index of the set bit that has `n` set bits below it.
fn nth_bit(bits: u32, n: u32) -> u32 {
    return search_half(search_half(search_half(search_half(search_half(BitSearch(bits, n, 0u), 16u), 8u), 4u), 2u), 1u).at;
}

// Tests a pixel's ray, and stores its hit if it precedes the best one by t, then by index.
@if(WATERTIGHT)
fn test_pixel(leaf: u32, pixel: vec2<u32>, root: RelativeRoot) {
    let ray = camera_ray(pixel_direction(pixel), eye(), root);
    let corners = permuted_corners(ray.axes, leaf);
    let edges = edges_of(ray, corners);
    if surely_misses_triangle(edges) { return; }
    let t = distance_to(ray, corners, edges);
    if !(t > ray.t_min && t < ray.t_max) { return; }
    let key = (u64(bitcast<u32>(t)) << 32u) | u64(corners.triangle);
    atomicMin(&visibility[pixel.y * params.width + pixel.x], key);
}

// Tests a pixel's ray, and stores its hit if it is one of the first two. Each atomic minimum on the first
// key passes its greater operand to the second key. So every key except the least reaches the second key.
@else
fn test_pixel(leaf: u32, pixel: vec2<u32>, root: RelativeRoot) {
    let ray = camera_ray(pixel_direction(pixel), eye(), root);
    let i = pixel.y * params.width + pixel.x;
    let nearest = nearest_t(i, ray, leaf);
    if !(nearest < ray.t_max) { return; }
    let key = (u64(bitcast<u32>(nearest)) << 32u) | u64(leaf);
    let later = max(key, atomicMin(&visibility[2u * i], key));
    if (later >> 32u) != u64(0xffffffffu) { atomicMin(&visibility[2u * i + 1u], later); }
}

fn test_tiles(tile: vec4<u32>, root: RelativeRoot, lane: u32) {
    let count = countOneBits(tile.z);
    let end = group_inclusive_sum(count, lane);
    let total = group_shuffle(end, 31u, lane);
    for (var first = 0u; first < total; first += 32u) {
        let k = first + lane;
        let owner = count_at_most(k, end, lane);
        let leaf = group_shuffle(tile.x, owner, lane);
        let corner = group_shuffle(tile.y, owner, lane);
        let bit = nth_bit(group_shuffle(tile.z, owner, lane), k - group_shuffle(end - count, owner, lane));
        let pixel = vec2<u32>(corner & 0xffffu, corner >> 16u) + vec2<u32>(bit & 7u, bit >> 3u);
        if k < total { test_pixel(leaf, pixel, root); }
    }
}

// Tests the tiles of one of `teams` teams: groups of 32 invocations that take turns in loading 32 tiles.
fn test_tiles_of_team(team: u32, teams: u32, count: u32, lane: u32) {
    let root = root_relative_to(eye());
    for (var first = 32u * team; first < count; first += 32u * teams) {
        var tile = vec4<u32>(0u);
        if first + lane < count { tile = pixel_coverage[LARGE_CAPACITY + first + lane]; }
        test_tiles(tile, root, lane);
    }
}

// Returns whether all tiles were stored and the tests take less time than traversal would.
fn is_rasterization_complete(tiles: u32, pixels: u32) -> bool {
    return tiles <= params.raster.tile_capacity
        && atomicLoad(&counts[LARGE_TRIANGLE_COUNT]) <= LARGE_CAPACITY
        && atomicLoad(&counts[TEST_COUNT]) <= 2u * pixels;
}

// Returns the number of tiles to test, the same for all invocations of a workgroup.
fn load_tile_count(local: u32, group: u32) -> u32 {
    if local == 0u {
        let count = atomicLoad(&counts[TILE_COUNT]);
        let pixels = params.width * params.height;
        let is_complete = is_rasterization_complete(count, pixels);
        tile_count = select(0u, count, is_complete);
        if !is_complete && group == 0u {
            atomicStore(&counts[RASTER_INCOMPLETE], 1u);
            atomicMin(&visibility[KEYS_PER_PIXEL * pixels], u64(0u));
        }
    }
    return workgroupUniformLoad(&tile_count);
}

// First hits, tile by tile. Each workgroup is a team.
//
// Variants: intersector, arithmetic.
// Parameters: raster.
@compute @workgroup_size(32)
fn rasterize(
    @builtin(local_invocation_index) lane: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    test_tiles_of_team(group.x, groups.x, load_tile_count(lane, group.x), lane);
}

// First hits, tile by tile. Each subgroup is a team.
//
// Variants: intersector, arithmetic, subgroups.
// Parameters: raster.
@compute @workgroup_size(128)
fn rasterize_by_subgroups(
    @builtin(local_invocation_index) local: u32,
    @builtin(subgroup_invocation_id) lane: u32,
    @builtin(subgroup_id) team: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    test_tiles_of_team(4u * group.x + team, 4u * groups.x, load_tile_count(local, group.x), lane);
}
