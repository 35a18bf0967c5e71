// Rasterization, first step: writes the pixels that each triangle may cover, as tiles. See docs/design/visibility-buffer.md.

import package::geometry::queries::eye;
import package::geometry::ray::root_relative_to;
import package::lib::buffers::{counts, pixel_coverage};
import package::lib::counters::{LARGE_TRIANGLE_COUNT, TEST_COUNT, TILE_COUNT};
import package::lib::params::{element_index, params};
import package::visibility::outline::{Outline, loose_tile_mask, outline_of, without_edges};

// The buffer `pixel_coverage` during rasterization, in rows of 16 bytes. First the leaves of triangles that are too large
// for `cover_small`, one row each. Then the tiles, one row each: a leaf, the first of 8 x 4 pixels (column and row, 16 bits
// each), and a bit for each pixel that the triangle may cover, row by row.

// Capacity for large triangles.
const LARGE_CAPACITY: u32 = 4096u;
const TILE_SIZE: vec2<i32> = vec2<i32>(8, 4);

// Number of keys per pixel in the visibility buffer: see rasterize.wgsl.
@if(WATERTIGHT)
const KEYS_PER_PIXEL: u32 = 1u;
@else
const KEYS_PER_PIXEL: u32 = 2u;

// Allocation of a workgroup's tiles, and the number of their tests.

var<workgroup> group_tile_count: atomic<u32>;
var<workgroup> group_test_count: atomic<u32>;
var<workgroup> group_first_tile: u32;

fn store_tile(at: u32, leaf: u32, corner: vec2<i32>, pixels: u32) {
    pixel_coverage[LARGE_CAPACITY + at] = vec4<u32>(leaf, u32(corner.x) | (u32(corner.y) << 16u), pixels, 0u);
}

// Indices of the first tile of a workgroup and of an invocation.
struct TileRange { first: u32, own_first: u32 }

fn allocate_tiles(tiles: u32, tests: u32, local: u32) -> TileRange {
    if local == 0u {
        atomicStore(&group_tile_count, 0u);
        atomicStore(&group_test_count, 0u);
    }
    workgroupBarrier();
    var at = 0u;
    if tiles > 0u {
        at = atomicAdd(&group_tile_count, tiles);
        atomicAdd(&group_test_count, tests);
    }
    workgroupBarrier();
    if local == 0u {
        group_first_tile = atomicAdd(&counts[TILE_COUNT], atomicLoad(&group_tile_count));
        atomicAdd(&counts[TEST_COUNT], atomicLoad(&group_test_count));
    }
    let first = workgroupUniformLoad(&group_first_tile);
    return TileRange(first, first + at);
}

// Small triangles, one per invocation: see docs/design/visibility-buffer.md.

// Largest number of tiles that one invocation writes for a triangle.
const MAX_TILES: i32 = 32;

// Number of tiles of an outline, approximate number of tests, and the pixels of a single tile. An empty single tile is dropped.
struct TileCounts { tiles: u32, tests: u32, pixels: u32 }

const NO_TILES: TileCounts = TileCounts(0u, 0u, 0u);

// Counts the tiles of an outline. If there are more than MAX_TILES, returns NO_TILES and appends the leaf to the list
// of large triangles.
fn count_tiles(outline: Outline, leaf: u32) -> TileCounts {
    if any(outline.first > outline.last) { return NO_TILES; }
    let size = outline.last - outline.first + 1;
    let blocks = (size + TILE_SIZE - 1) / TILE_SIZE;
    if all(blocks == vec2<i32>(1)) {
        let pixels = loose_tile_mask(outline, outline.first);
        return TileCounts(min(pixels, 1u), countOneBits(pixels), pixels);
    }
    if blocks.x * blocks.y <= MAX_TILES { return TileCounts(u32(blocks.x * blocks.y), u32(outline.covered), 0u); }
    let index = atomicAdd(&counts[LARGE_TRIANGLE_COUNT], 1u);
    if index < LARGE_CAPACITY { pixel_coverage[index].x = leaf; }
    return NO_TILES;
}

fn store_tiles(outline: Outline, leaf: u32, first: u32) {
    var index = first;
    for (var y = outline.first.y; y <= outline.last.y; y += TILE_SIZE.y) {
        for (var x = outline.first.x; x <= outline.last.x; x += TILE_SIZE.x) {
            store_tile(index, leaf, vec2<i32>(x, y), loose_tile_mask(outline, vec2<i32>(x, y)));
            index += 1u;
        }
    }
}

// Variants: intersector.
// Parameters: raster.
@compute @workgroup_size(256)
fn cover_small(
    @builtin(local_invocation_index) local: u32,
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let leaf = element_index(id, groups, 256u);
    let origin = eye();
    var outline = without_edges(vec2<i32>(0), vec2<i32>(-1));
    if leaf < params.count { outline = outline_of(leaf, origin, root_relative_to(origin).max_distance); }
    let tile_counts = count_tiles(outline, leaf);
    let first = allocate_tiles(tile_counts.tiles, tile_counts.tests, local).own_first;
    if tile_counts.tiles == 0u || first + tile_counts.tiles > params.raster.tile_capacity { return; }
    if tile_counts.tiles == 1u {
        store_tile(first, leaf, outline.first, tile_counts.pixels);
    } else {
        store_tiles(outline, leaf, first);
    }
}

// Large triangles. The workgroups are distributed evenly over them.

// Number of pixels that a workgroup's tiles span, along both axes of the picture.
const GROUP_PIXELS: vec2<i32> = vec2<i32>(128, 32);

// Writes the tiles of a large triangle that one of `groups_per_triangle` workgroups is responsible for.
fn store_share(leaf: u32, local: u32, first: i32, groups_per_triangle: i32) {
    let origin = eye();
    let outline = outline_of(leaf, origin, root_relative_to(origin).max_distance);
    let blocks = (outline.last - outline.first + GROUP_PIXELS) / GROUP_PIXELS;
    for (var k = first; k < blocks.x * blocks.y; k += groups_per_triangle) {
        let corner = outline.first + GROUP_PIXELS * vec2<i32>(k % blocks.x, k / blocks.x)
            + vec2<i32>(8 * i32(local & 15u), 4 * i32(local >> 4u));
        var pixels = 0u;
        if all(corner <= outline.last) { pixels = loose_tile_mask(outline, corner); }
        let range = allocate_tiles(min(pixels, 1u), countOneBits(pixels), local);
        // The tiles do not fit, so rasterization is incomplete anyway.
        if range.first > params.raster.tile_capacity { break; }
        if pixels != 0u && range.own_first < params.raster.tile_capacity { store_tile(range.own_first, leaf, corner, pixels); }
    }
}

// Variants: intersector.
// Parameters: raster.
@compute @workgroup_size(128)
fn cover_large(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let count = atomicLoad(&counts[LARGE_TRIANGLE_COUNT]);
    if count == 0u || count > LARGE_CAPACITY { return; }
    let groups_per_triangle = max(groups.x / count, 1u);
    let triangles_at_once = groups.x / groups_per_triangle;
    for (var k = group.x / groups_per_triangle; k < count; k += triangles_at_once) {
        store_share(pixel_coverage[k].x, local, i32(group.x % groups_per_triangle), i32(groups_per_triangle));
    }
}
