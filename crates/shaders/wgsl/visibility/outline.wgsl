// Projects triangles and boxes to the picture, and bounds the pixels that they may cover.

import package::geometry::ray::{MAX_DISTANCE, max_component, min_component};
import package::geometry::record::{corners_of, is_unhittable};
import package::lib::buffers::records;
import package::lib::double_float::sub_each;
import package::lib::params::params;

// The buffer `pixel_coverage` for packets, in rows of 16 bytes. First come the lanes of the wide tree (the children of
// its nodes), one row each. From row `wide_lanes` on follow the triangles in leaf order, two rows each.
//
// The row of a lane and the first row of a triangle begin with two spans of pixels, of columns and of rows, and with
// the bits of the nearest depth. The row of a lane ends with a reference to its child. The first row of a triangle ends
// with the offset of the third line. Its second row has the other offsets and all slopes (see `RowBound` in
// project.wgsl).

// A span of pixels: the first one in the lower 16 bits, the last one in the upper 16 bits. It is empty if the first is
// after the last.
const EMPTY_SPAN: u32 = 0x0000ffffu;
const FULL_SPAN: u32 = 0xffff0000u;

// Flag of a reference in the wide tree: a block of consecutive leaves, else a wide node. The lower six bits are the
// number of leaves or lanes, and the bits above are the index of the first one.
const BLOCK: u32 = 0x80000000u;
// Offset of an absent line, in 256ths of a pixel.
const UNBOUNDED: i32 = 0x20000000;

// Projection of points to the picture, with error bounds.

// Bound on the error of a picture coordinate, as a factor of
// max_distance * (l1_norm(axis) + |at| * l1_norm(params.depth)) / (depth of the point): see docs/design/packets.md.
// 16 * 2^-24.
@if(WATERTIGHT || EXACT)
const PROJECTION_ERROR: f32 = 9.5367431640625e-7;

// 36 * 2^-24.
@else
const PROJECTION_ERROR: f32 = 2.1457672119140625e-6;

// Distance from the picture, in pixels, beyond which coverage is not computed.
const MAX_OFFSCREEN_PIXELS: f32 = 16384.0;

// Bound on the error of a depth, and of the depth of a hit, as a factor of
// max_distance * l1_norm(params.depth): see docs/design/packets.md. 38 * 2^-24.
@if(EXACT)
const DEPTH_ERROR: f32 = 2.26497650146484375e-6;

// 57 * 2^-24.
@else
const DEPTH_ERROR: f32 = 3.397464752197265625e-6;

fn l1_norm(v: vec3<f32>) -> f32 { return abs(v.x) + abs(v.y) + abs(v.z); }

// Projected coordinates along one axis of the picture, and their error bounds.
struct Projected { at: vec3<f32>, error_bound: vec3<f32> }

fn loose_project(axis: vec3<f32>, x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, inverse: vec3<f32>, max_distance: f32) -> Projected {
    let at = (axis.x * x + axis.y * y + axis.z * z) * inverse;
    let error_bound = PROJECTION_ERROR * max_distance * (l1_norm(axis) + abs(at) * l1_norm(params.depth)) * inverse;
    return Projected(at - 0.5, error_bound);
}

fn is_precise(p: Projected) -> bool {
    return max_component(abs(p.at)) < MAX_OFFSCREEN_PIXELS && max_component(p.error_bound) < 1.0;
}

// Returns the depth below which a depth's relative error may exceed 1/64. `DEPTH_ERROR` is larger, because it also
// bounds the error of a hit's depth.
fn near_limit(max_distance: f32) -> f32 { return 64.0 * PROJECTION_ERROR * max_distance * l1_norm(params.depth); }

// Returns whether a triangle is certainly beyond one side of the picture. Also correct for a triangle that reaches behind the
// eye: points there are not visible. In front of the eye, `across` is column times depth, and `down` is row times depth. So the
// signs of `across` and `across - width * depths` show on which side of the left and the right border a point is.
@if(!WATERTIGHT)
fn is_triangle_outside(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, depths: vec3<f32>, max_distance: f32) -> bool {
    let across = params.column.x * x + params.column.y * y + params.column.z * z;
    let down = params.row.x * x + params.row.y * y + params.row.z * z;
    return is_outside(
        vec2<f32>(min_component(across - f32(params.width) * depths), max_component(across)),
        params.column, params.width, max_distance,
    ) || is_outside(
        vec2<f32>(min_component(down - f32(params.height) * depths), max_component(down)),
        params.row, params.height, max_distance,
    );
}

// The computed t of a needle may be anywhere in the triangle's own box, so the box decides.
@if(WATERTIGHT)
fn is_triangle_outside(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, depths: vec3<f32>, max_distance: f32) -> bool {
    let own = own_box_of(x, y, z);
    return is_box_outside(own.low, own.high, max_distance);
}

// Returns whether the triangle is certainly behind the eye. With `watertight`, its own box must be.
fn is_triangle_behind(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, depths: vec3<f32>, max_distance: f32) -> bool {
    @if(WATERTIGHT) let farthest = max_box_depth(own_box_of(x, y, z));
    @else let farthest = max_component(depths);
    return farthest < -near_limit(max_distance) && max_distance < MAX_DISTANCE;
}

// The bounds of a triangle, relative to the eye.
struct OwnBox { low: vec3<f32>, high: vec3<f32> }

fn own_box_of(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>) -> OwnBox {
    return OwnBox(
        vec3<f32>(min_component(x), min_component(y), min_component(z)),
        vec3<f32>(max_component(x), max_component(y), max_component(z)),
    );
}

fn min_box_depth(b: OwnBox) -> f32 {
    let least = min(params.depth * b.low, params.depth * b.high);
    return least.x + least.y + least.z;
}

fn max_box_depth(b: OwnBox) -> f32 {
    let most = max(params.depth * b.low, params.depth * b.high);
    return most.x + most.y + most.z;
}

// Returns whether a box is certainly beyond one side of the picture.
fn is_box_outside(low: vec3<f32>, high: vec3<f32>, max_distance: f32) -> bool {
    return is_box_outside_along(low, high, params.column, params.width, max_distance)
        || is_box_outside_along(low, high, params.row, params.height, max_distance);
}

fn is_box_outside_along(low: vec3<f32>, high: vec3<f32>, axis: vec3<f32>, size: u32, max_distance: f32) -> bool {
    let last = axis - f32(size) * params.depth;
    let least = min(last * low, last * high);
    let most = max(axis * low, axis * high);
    return is_outside(vec2<f32>(least.x + least.y + least.z, most.x + most.y + most.z), axis, size, max_distance);
}

// Returns whether an object is certainly outside the picture along one axis. `min_and_max` holds the least projected
// coordinate minus the picture's size, and the greatest projected coordinate, both multiplied by the depth.
fn is_outside(min_and_max: vec2<f32>, axis: vec3<f32>, size: u32, max_distance: f32) -> bool {
    let error_bound = DEPTH_ERROR * max_distance * (l1_norm(axis) + f32(size) * l1_norm(params.depth));
    return max_distance < MAX_DISTANCE && (min_and_max.x > error_bound || min_and_max.y < -error_bound);
}

// Returns a lower bound, at least 0, on the depth of hits in an object whose least computed depth is `depth`.
fn nearest_depth(depth: f32, max_distance: f32) -> f32 {
    let least = depth - DEPTH_ERROR * max_distance * l1_norm(params.depth);
    return select(0.0, least, least > 0.0);
}

// Returns the first and last pixel whose ray may pass between two coordinates.
fn loose_pixel_span(least: f32, most: f32) -> u32 {
    let first = clamp(ceil(least - params.pixel_margin), 0.0, 65535.0);
    let last = clamp(floor(most + params.pixel_margin), -1.0, 65535.0);
    return select(EMPTY_SPAN, u32(first) | (u32(last) << 16u), first <= last);
}

// The part of the picture that a box covers: columns, rows, and the bits of its nearest depth.
struct BoxCoverage { columns: u32, rows: u32, begin: u32 }

const NO_COVERAGE: BoxCoverage = BoxCoverage(EMPTY_SPAN, EMPTY_SPAN, 0u);

// Projects a box by its corners, one pair along x at a time. `low` and `high` are relative to the eye.
fn project_box(low: vec3<f32>, high: vec3<f32>, max_distance: f32) -> BoxCoverage {
    var nearest = 3.0e38;
    var farthest = -3.0e38;
    var least = vec2<f32>(3.0e38);
    var most = vec2<f32>(-3.0e38);
    var is_precise_everywhere = max_distance < MAX_DISTANCE;
    for (var k = 0u; k < 4u; k += 1u) {
        let y = vec3<f32>(select(low.y, high.y, (k & 1u) != 0u));
        let z = vec3<f32>(select(low.z, high.z, (k & 2u) != 0u));
        let x = vec3<f32>(low.x, high.x, low.x);
        let depths = params.depth.x * x + params.depth.y * y + params.depth.z * z;
        let inverse = 1.0 / depths;
        let across = loose_project(params.column, x, y, z, inverse, max_distance);
        let down = loose_project(params.row, x, y, z, inverse, max_distance);
        is_precise_everywhere = is_precise_everywhere && is_precise(across) && is_precise(down);
        nearest = min(nearest, min_component(depths));
        farthest = max(farthest, max_component(depths));
        least = min(least, vec2<f32>(min_component(across.at - across.error_bound), min_component(down.at - down.error_bound)));
        most = max(most, vec2<f32>(max_component(across.at + across.error_bound), max_component(down.at + down.error_bound)));
    }
    if farthest < -near_limit(max_distance) && max_distance < MAX_DISTANCE { return NO_COVERAGE; }
    let begin = bitcast<u32>(select(0.0, nearest_depth(nearest, max_distance), max_distance < MAX_DISTANCE));
    if is_precise_everywhere && nearest > near_limit(max_distance) {
        return BoxCoverage(loose_pixel_span(least.x, most.x), loose_pixel_span(least.y, most.y), begin);
    }
    let all = select(FULL_SPAN, EMPTY_SPAN, is_box_outside(low, high, max_distance));
    return BoxCoverage(all, all, begin);
}

// Projects the own box of a leaf's triangle. Textbook tests may accept any ray that meets this box.
fn project_own_box(leaf: u32, origin: vec3<f32>, max_distance: f32) -> BoxCoverage {
    if is_unhittable(leaf) { return NO_COVERAGE; }
    let corners = corners_of(leaf);
    return project_box(
        min(min(corners.a, corners.b), corners.c) - origin, max(max(corners.a, corners.b), corners.c) - origin, max_distance,
    );
}

// A triangle's outline in the picture, slightly enlarged: see docs/design/visibility-buffer.md.

// The rectangle of pixels is empty if `first` is after `last`. Each edge bounds the covered pixels of every row: at
// column `at` in the first row, plus `slope` for each further row. Side -1 is where covered pixels begin, side 1 where
// they end. `covered` is the approximate number of covered pixels.
struct Outline { first: vec2<i32>, last: vec2<i32>, at: vec3<f32>, slope: vec3<f32>, side: vec3<f32>, covered: f32 }

fn without_edges(first: vec2<i32>, last: vec2<i32>) -> Outline {
    let size = vec2<f32>(last - first + 1);
    return Outline(first, last, vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0), size.x * size.y);
}

fn loose_first_pixel(p: Projected) -> i32 {
    return i32(max(ceil(min_component(p.at - p.error_bound) - params.pixel_margin), 0.0));
}

fn loose_last_pixel(p: Projected, size: u32) -> i32 {
    return i32(clamp(floor(max_component(p.at + p.error_bound) + params.pixel_margin), -1.0, f32(size) - 1.0));
}

// Returns for each corner the coordinate of the next corner minus its own. Each difference is rounded exactly once, as
// the error bounds require.
fn to_next(at: vec3<f32>) -> vec3<f32> { return sub_each(at.yzx, at); }

// Adds the triangle's edges. A corner is off by at most its error bound, and a pixel's ray by at most `pixel_margin`
// from the pixel's middle. So each edge moves outward by the sum of both. Edges that are nearly level do not bound
// rows. If the area may be zero, the orientation is unknown and no edge is used.
fn loose_edges(given: Outline, across: Projected, down: Projected) -> Outline {
    var outline = given;
    let x = across.at;
    let y = down.at;
    let dx = to_next(x);
    let dy = to_next(y);
    let size = vec2<f32>(abs(dx.x) + abs(dx.y) + abs(dx.z), abs(dy.x) + abs(dy.y) + abs(dy.z));
    let area = dx.x * dy.y - dy.x * dx.y;
    // 2^-21
    if !(abs(area) > 4.76837158203125e-7 * size.x * size.y) { return outline; }
    let slope = dx / dy;
    let displacement = slope * (f32(outline.first.y) - y);
    let margin = max(max_component(across.error_bound), max_component(down.error_bound)) + params.pixel_margin;
    let padding = margin * (abs(slope) + 1.0) + 4.0e-6 * (abs(displacement) + abs(slope) * size.y + abs(x) + 1.0);
    let side = sign(area) * sign(dy);
    outline.side = select(vec3<f32>(0.0), side, abs(slope) < vec3<f32>(100.0));
    outline.slope = slope;
    outline.at = x + displacement + side * padding;
    outline.covered = min(outline.covered, 0.5 * abs(area));
    return outline;
}

// Returns the rectangle of the triangle's own box.
@if(MOLLER_TRUMBORE || WOOP)
fn outline_of(leaf: u32, origin: vec3<f32>, max_distance: f32) -> Outline {
    let coverage = project_own_box(leaf, origin, max_distance);
    let pixels = vec2<u32>(coverage.columns, coverage.rows);
    let last = min(vec2<i32>(pixels >> vec2<u32>(16u)), vec2<i32>(i32(params.width), i32(params.height)) - 1);
    return without_edges(vec2<i32>(pixels & vec2<u32>(0xffffu)), last);
}

@else
fn outline_of(leaf: u32, origin: vec3<f32>, max_distance: f32) -> Outline {
    let first = records[3u * leaf];
    let x = bitcast<vec3<f32>>(first.xyz) - origin.x;
    let y = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz) - origin.y;
    let z = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz) - origin.z;
    let depths = params.depth.x * x + params.depth.y * y + params.depth.z * z;
    let is_behind = is_triangle_behind(x, y, z, depths, max_distance);
    if is_unhittable(leaf) || is_behind { return without_edges(vec2<i32>(0), vec2<i32>(-1)); }
    let inverse = 1.0 / depths;
    let across = loose_project(params.column, x, y, z, inverse, max_distance);
    let down = loose_project(params.row, x, y, z, inverse, max_distance);
    if !(min_component(depths) > near_limit(max_distance) && is_precise(across) && is_precise(down)) {
        let last = vec2<i32>(i32(params.width), i32(params.height)) - 1;
        return without_edges(vec2<i32>(0), select(last, vec2<i32>(-1), is_triangle_outside(x, y, z, depths, max_distance)));
    }
    let corner = vec2<i32>(loose_first_pixel(across), loose_first_pixel(down));
    let outline = without_edges(corner, vec2<i32>(loose_last_pixel(across, params.width), loose_last_pixel(down, params.height)));
    if any(outline.first > outline.last) { return outline; }
    return loose_edges(outline, across, down);
}

// Returns the pixels of an 8 x 4 tile that may be covered, one bit each, row by row.
fn loose_tile_mask(outline: Outline, corner: vec2<i32>) -> u32 {
    var pixels = 0u;
    for (var row = 0; row < 4; row += 1) {
        let y = corner.y + row;
        let at = outline.at + outline.slope * f32(y - outline.first.y);
        let low = select(vec3<f32>(-1.0e9), at, outline.side < vec3<f32>(0.0));
        let high = select(vec3<f32>(1.0e9), at, outline.side > vec3<f32>(0.0));
        let first = clamp(max(i32(ceil(max_component(low))), outline.first.x) - corner.x, 0, 8);
        let last = clamp(min(i32(floor(min_component(high))), outline.last.x) - corner.x, -1, 7);
        let bits = (0xffu << u32(first)) & (0xffu >> u32(7 - last));
        pixels |= select(0u, bits << u32(8 * row), y <= outline.last.y);
    }
    return pixels;
}
