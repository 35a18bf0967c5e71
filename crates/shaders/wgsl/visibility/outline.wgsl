// Coverage of the picture by a triangle.

import package::geometry::ray::{FARTHEST, least_of, most_of};
import package::geometry::record::NO_TRIANGLE;
import package::lib::buffers::records;
import package::lib::params::params;

// The buffer `covers` for packets, in rows of 16 bytes. All first rows begin with the first and last column, the first and last
// row (16 bits each), and the nearest depth as a float's bits. First come the lanes of the wide tree, one row each, which ends
// with the child that the lane refers to. From row `wide_lanes` on follow the triangles in leaf order, two rows each. Their first
// row ends with the offset of the third line; the second row has the other offsets and all slopes (see `RowBound` in
// project.wgsl).

// The first pixel is after the last: nothing is covered.
const NOWHERE: u32 = 0x0000ffffu;
const EVERYWHERE: u32 = 0xffff0000u;

const BLOCK: u32 = 0x80000000u;
// Offset of an absent line, in 256ths of a pixel.
const BOUNDLESS: i32 = 0x20000000;

// Projection of points to the picture, with error bounds.

// DOUBT is 16 * 2^-24: the error of a picture coordinate relative to its terms. Beyond OUTER pixels, coverage is not computed.
const DOUBT: f32 = 9.5367431640625e-7;
const OUTER: f32 = 16384.0;

fn size_of(v: vec3<f32>) -> f32 { return abs(v.x) + abs(v.y) + abs(v.z); }

// Projected coordinates along one axis of the picture, and their error bounds.
struct Places { at: vec3<f32>, doubt: vec3<f32> }

fn loose_places(axis: vec3<f32>, x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, inverse: vec3<f32>, reach: f32) -> Places {
    let at = (axis.x * x + axis.y * y + axis.z * z) * inverse;
    let doubt = DOUBT * reach * (size_of(axis) + abs(at) * size_of(params.depth)) * inverse;
    return Places(at - 0.5, doubt);
}

fn is_near(p: Places) -> bool { return most_of(abs(p.at)) < OUTER && most_of(p.doubt) < 1.0; }

// Returns the depth below which the error of a depth may exceed a 64th.
fn too_near(reach: f32) -> f32 { return 64.0 * DOUBT * reach * size_of(params.depth); }

// Returns whether a triangle is surely beyond one side of the picture. This also holds if it reaches behind the eye: no point
// there is visible, and in front of the eye the sign of column times depth determines the side.
fn is_triangle_beside(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, depths: vec3<f32>, reach: f32) -> bool {
    let across = params.column.x * x + params.column.y * y + params.column.z * z;
    let down = params.row.x * x + params.row.y * y + params.row.z * z;
    return are_beside(vec2<f32>(least_of(across - f32(params.width) * depths), most_of(across)), params.column, params.width, reach)
        || are_beside(vec2<f32>(least_of(down - f32(params.height) * depths), most_of(down)), params.row, params.height, reach);
}

// The same for a box with these corners.
fn is_box_beside(low: vec3<f32>, high: vec3<f32>, reach: f32) -> bool {
    return is_box_beside_along(low, high, params.column, params.width, reach) || is_box_beside_along(low, high, params.row, params.height, reach);
}

fn is_box_beside_along(low: vec3<f32>, high: vec3<f32>, axis: vec3<f32>, size: u32, reach: f32) -> bool {
    let last = axis - f32(size) * params.depth;
    let least = min(last * low, last * high);
    let most = max(axis * low, axis * high);
    return are_beside(vec2<f32>(least.x + least.y + least.z, most.x + most.y + most.z), axis, size, reach);
}

// Decides by two bounds, both times depth: the least projected coordinate minus the picture's size, and the greatest one.
fn are_beside(least_and_most: vec2<f32>, axis: vec3<f32>, size: u32, reach: f32) -> bool {
    let doubt = DOUBT * reach * (size_of(axis) + f32(size) * size_of(params.depth));
    return reach < FARTHEST && (least_and_most.x > doubt || least_and_most.y < -doubt);
}

// A triangle's outline in the picture, slightly enlarged: see docs/design/visibility-buffer.md.

// The rectangle of pixels is empty if `first` is after `last`. Each edge bounds every row of pixels: at `at` in the first row, plus
// `slope` per row. On side -1 covered pixels begin there, on side 1 they end. `covered` is the approximate number of covered pixels.
struct Outline { first: vec2<i32>, last: vec2<i32>, at: vec3<f32>, slope: vec3<f32>, side: vec3<f32>, covered: f32 }

fn without_edges(first: vec2<i32>, last: vec2<i32>) -> Outline {
    let size = vec2<f32>(last - first + 1);
    return Outline(first, last, vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0), size.x * size.y);
}

fn loose_first(p: Places) -> i32 { return i32(max(ceil(least_of(p.at - p.doubt) - params.pixel_margin), 0.0)); }

fn loose_last(p: Places, size: u32) -> i32 {
    return i32(clamp(floor(most_of(p.at + p.doubt) + params.pixel_margin), -1.0, f32(size) - 1.0));
}

// Moving the corners by their error bounds and the pixels by the margin moves the interior by at most the sum. Edges that are
// nearly level do not bound rows. If the area may be zero, the orientation is unknown and no edge is used.
fn loose_edges(given: Outline, across: Places, down: Places) -> Outline {
    var o = given;
    let x = across.at;
    let y = down.at;
    let dx = x.yzx - x;
    let dy = y.yzx - y;
    let size = vec2<f32>(abs(dx.x) + abs(dx.y) + abs(dx.z), abs(dy.x) + abs(dy.y) + abs(dy.z));
    let area = dx.x * dy.y - dy.x * dx.y;
    // 2^-21
    if !(abs(area) > 4.76837158203125e-7 * size.x * size.y) { return o; }
    let slope = dx / dy;
    let way = slope * (f32(o.first.y) - y);
    let margin = max(most_of(across.doubt), most_of(down.doubt)) + params.pixel_margin;
    let apart = margin * (abs(slope) + 1.0) + 4.0e-6 * (abs(way) + abs(slope) * size.y + abs(x) + 1.0);
    let side = sign(area) * sign(dy);
    o.side = select(vec3<f32>(0.0), side, abs(slope) < vec3<f32>(100.0));
    o.slope = slope;
    o.at = x + way + side * apart;
    o.covered = min(o.covered, 0.5 * abs(area));
    return o;
}

fn outline_of(leaf: u32, origin: vec3<f32>, reach: f32) -> Outline {
    let first = records[3u * leaf];
    let x = bitcast<vec3<f32>>(first.xyz) - origin.x;
    let y = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz) - origin.y;
    let z = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz) - origin.z;
    let depths = params.depth.x * x + params.depth.y * y + params.depth.z * z;
    let is_behind = most_of(depths) < -too_near(reach) && reach < FARTHEST;
    if first.w == NO_TRIANGLE || is_behind { return without_edges(vec2<i32>(0), vec2<i32>(-1)); }
    let inverse = 1.0 / depths;
    let across = loose_places(params.column, x, y, z, inverse, reach);
    let down = loose_places(params.row, x, y, z, inverse, reach);
    if !(least_of(depths) > too_near(reach) && is_near(across) && is_near(down)) {
        let last = vec2<i32>(i32(params.width), i32(params.height)) - 1;
        return without_edges(vec2<i32>(0), select(last, vec2<i32>(-1), is_triangle_beside(x, y, z, depths, reach)));
    }
    let corner = vec2<i32>(loose_first(across), loose_first(down));
    let o = without_edges(corner, vec2<i32>(loose_last(across, params.width), loose_last(down, params.height)));
    if any(o.first > o.last) { return o; }
    return loose_edges(o, across, down);
}

// Returns the pixels of an 8 x 4 tile that may be covered, one bit each, row by row.
fn loose_stamp(o: Outline, corner: vec2<i32>) -> u32 {
    var pixels = 0u;
    for (var row = 0; row < 4; row += 1) {
        let y = corner.y + row;
        let at = o.at + o.slope * f32(y - o.first.y);
        let low = select(vec3<f32>(-1.0e9), at, o.side < vec3<f32>(0.0));
        let high = select(vec3<f32>(1.0e9), at, o.side > vec3<f32>(0.0));
        let first = clamp(max(i32(ceil(most_of(low))), o.first.x) - corner.x, 0, 8);
        let last = clamp(min(i32(floor(least_of(high))), o.last.x) - corner.x, -1, 7);
        let bits = (0xffu << u32(first)) & (0xffu >> u32(7 - last));
        pixels |= select(0u, bits << u32(8 * row), y <= o.last.y);
    }
    return pixels;
}
