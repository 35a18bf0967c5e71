// Rasterization, first step: writes the pixels that each triangle may cover, as tiles. See docs/design/visibility-buffer.md.

import package::geometry::queries::eye;
import package::lib::buffers::{counts, covers};
import package::lib::counters::{LARGE_TRIANGLE_COUNT, TEST_COUNT, TILE_COUNT};
import package::lib::params::{element, params};
import package::visibility::outline::{Outline, cover_reach, loose_stamp, outline_of, without_edges};

// The buffer `covers` during rasterization, in rows of 16 bytes. First one row per triangle that was too large for `cover_small`:
// its leaf. Then the tiles: a leaf, the first of 8 x 4 pixels (column and row, 16 bits each), and a bit for each pixel that the
// triangle may cover, row by row.

// Capacity for large triangles.
const LISTED: u32 = 4096u;
const SIDES: vec2<i32> = vec2<i32>(8, 4);

// Elements of the visibility buffer per pixel.
@if(WATERTIGHT)
const KEPT: u32 = 1u;
@else
const KEPT: u32 = 2u;

// Storage of a workgroup's tiles, and the count of their tests.

var<workgroup> made: atomic<u32>;
var<workgroup> tests_of_all: atomic<u32>;
var<workgroup> first_of_all: u32;

fn keep_tile(at: u32, leaf: u32, corner: vec2<i32>, pixels: u32) {
    covers[LISTED + at] = vec4<u32>(leaf, u32(corner.x) | (u32(corner.y) << 16u), pixels, 0u);
}

// Where the tiles of a workgroup begin, and those of an invocation.
struct Place { first: u32, own: u32 }

fn place_stamps(own: u32, tests: u32, local: u32) -> Place {
    if local == 0u {
        atomicStore(&made, 0u);
        atomicStore(&tests_of_all, 0u);
    }
    workgroupBarrier();
    var at = 0u;
    if own > 0u {
        at = atomicAdd(&made, own);
        atomicAdd(&tests_of_all, tests);
    }
    workgroupBarrier();
    if local == 0u {
        first_of_all = atomicAdd(&counts[TILE_COUNT], atomicLoad(&made));
        atomicAdd(&counts[TEST_COUNT], atomicLoad(&tests_of_all));
    }
    let first = workgroupUniformLoad(&first_of_all);
    return Place(first, first + at);
}

// Small triangles, one per invocation: see docs/design/visibility-buffer.md.

// Largest number of tiles that one invocation writes for a triangle.
const MOST: i32 = 32;

// Number of tiles of an outline, approximate number of tests, and the pixels of a single tile. An empty single tile is not kept.
struct Own { tiles: u32, tests: u32, pixels: u32 }

const NO_TILES: Own = Own(0u, 0u, 0u);

// Returns no tiles for an outline with more than MOST tiles, and appends it to the list of large ones.
fn own_of(o: Outline, leaf: u32) -> Own {
    if any(o.first > o.last) { return NO_TILES; }
    let size = o.last - o.first + 1;
    let blocks = (size + SIDES - 1) / SIDES;
    if all(blocks == vec2<i32>(1)) {
        let pixels = loose_stamp(o, o.first);
        return Own(min(pixels, 1u), countOneBits(pixels), pixels);
    }
    if blocks.x * blocks.y <= MOST { return Own(u32(blocks.x * blocks.y), u32(o.covered), 0u); }
    let place = atomicAdd(&counts[LARGE_TRIANGLE_COUNT], 1u);
    if place < LISTED { covers[place].x = leaf; }
    return NO_TILES;
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

// Variants: intersector.
// Parameters: raster.
@compute @workgroup_size(256)
fn cover_small(@builtin(local_invocation_index) local: u32, @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let leaf = element(id, groups, 256u);
    let origin = eye();
    var o = without_edges(vec2<i32>(0), vec2<i32>(-1));
    if leaf < params.count { o = outline_of(leaf, origin, cover_reach(origin)); }
    let own = own_of(o, leaf);
    let at = place_stamps(own.tiles, own.tests, local).own;
    if own.tiles == 0u || at + own.tiles > params.raster.tiles { return; }
    if own.tiles == 1u { keep_tile(at, leaf, o.first, own.pixels); } else { keep_several(o, leaf, at); }
}

// Large triangles, over which the workgroups are distributed evenly.

// Number of pixels that a workgroup's tiles span, along both axes of the picture.
const STRIDE: vec2<i32> = vec2<i32>(128, 32);

// Writes the tiles of a large triangle that one of `sharers` workgroups is responsible for.
fn stamp_share(leaf: u32, local: u32, first: i32, sharers: i32) {
    let origin = eye();
    let o = outline_of(leaf, origin, cover_reach(origin));
    let blocks = (o.last - o.first + STRIDE) / STRIDE;
    for (var k = first; k < blocks.x * blocks.y; k += sharers) {
        let corner = o.first + STRIDE * vec2<i32>(k % blocks.x, k / blocks.x) + vec2<i32>(8 * i32(local & 15u), 4 * i32(local >> 4u));
        var pixels = 0u;
        if all(corner <= o.last) { pixels = loose_stamp(o, corner); }
        let place = place_stamps(min(pixels, 1u), countOneBits(pixels), local);
        // The tiles do not fit, so rasterization is incomplete anyway.
        if place.first > params.raster.tiles { break; }
        if pixels != 0u && place.own < params.raster.tiles { keep_tile(place.own, leaf, corner, pixels); }
    }
}

// Variants: intersector.
// Parameters: raster.
@compute @workgroup_size(128)
fn cover_large(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let count = atomicLoad(&counts[LARGE_TRIANGLE_COUNT]);
    if count == 0u || count > LISTED { return; }
    let sharers = max(groups.x / count, 1u);
    let abreast = groups.x / sharers;
    for (var k = group.x / sharers; k < count; k += abreast) {
        stamp_share(covers[k].x, local, i32(group.x % sharers), i32(sharers));
    }
}
