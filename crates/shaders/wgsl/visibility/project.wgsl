// Projects each triangle, and each box of the wide tree, to the pixels that it covers: see docs/design/packets.md.

import package::geometry::queries::eye;
import package::geometry::ray::{MAX_DISTANCE, max_component, min_component, root_relative_to};
import package::geometry::record::is_unhittable;
import package::lib::buffers::{nodes, pixel_coverage, records, topology};
import package::lib::params::{element_index, params};
import package::visibility::outline::{
    EMPTY_SPAN, FULL_SPAN, NO_COVERAGE, Projected, UNBOUNDED, is_precise, is_triangle_behind, is_triangle_outside, loose_pixel_span,
    loose_project, min_box_depth, near_limit, nearest_depth, own_box_of, project_box, project_own_box,
};

// A bound for every row of pixels, in 256ths of a pixel: `at` in the triangle's first row, plus `slope` for each further
// row. Covered pixels begin after it (side -1) or end before it (side 1). Side 0 is no bound.
struct RowBound { at: i32, slope: i32, side: i32 }

fn loose_line(p: vec2<f32>, q: vec2<f32>, orientation: f32, first: f32, margin: f32) -> RowBound {
    let d = q - p;
    let slope = d.x / d.y;
    // Lines that are nearly level do not bound rows.
    if !(abs(slope) < 100.0) { return RowBound(0, 0, 0); }
    let at = p.x + slope * (first - p.y);
    let padding = margin * (abs(slope) + 1.0) + 2.0e-6 * (abs(slope * (first - p.y)) + abs(p.x));
    if orientation * d.y > 0.0 { return RowBound(i32(ceil(256.0 * (at + padding))), i32(ceil(256.0 * slope)), 1); }
    // Adds 255 so that the later shift rounds up to whole pixels.
    return RowBound(i32(floor(256.0 * (at - padding))) + 255, i32(floor(256.0 * slope)), -1);
}

struct RowBounds { begin: RowBound, end: RowBound, third: RowBound }

fn no_lines() -> RowBounds { return RowBounds(RowBound(-UNBOUNDED, 0, 0), RowBound(UNBOUNDED, 0, 0), RowBound(0, 0, 0)); }

fn with_line(given: RowBounds, line: RowBound) -> RowBounds {
    var lines = given;
    if line.side == -1 && lines.begin.side == 0 {
        lines.begin = line;
    } else if line.side == 1 && lines.end.side == 0 {
        lines.end = line;
    } else if line.side != 0 {
        lines.third = line;
    }
    return lines;
}

// Returns a triangle's edges as lines, if its orientation is certain.
fn loose_lines(x: Projected, y: Projected, first: f32) -> RowBounds {
    let a = vec2<f32>(x.at.x, y.at.x);
    let b = vec2<f32>(x.at.y, y.at.y);
    let c = vec2<f32>(x.at.z, y.at.z);
    let error_bound = max(max_component(x.error_bound), max_component(y.error_bound));
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    let size = abs(b - a) + abs(c - b) + abs(a - c);
    var lines = no_lines();
    // 2^-21, because coordinates are rounded too.
    if !(abs(area) > 2.5 * (error_bound + 4.76837158203125e-7 * (max_component(abs(x.at)) + max_component(abs(y.at)))) * (size.x + size.y)) {
        return lines;
    }
    let orientation = sign(area);
    let margin = error_bound + params.pixel_margin;
    lines = with_line(lines, loose_line(a, b, orientation, first, margin));
    lines = with_line(lines, loose_line(b, c, orientation, first, margin));
    return with_line(lines, loose_line(c, a, orientation, first, margin));
}

// Packs the lower 16 bits of two numbers.
fn pack_halves(low: i32, high: i32) -> u32 { return (bitcast<u32>(low) & 0xffffu) | (bitcast<u32>(high) << 16u); }

fn write_triangle(leaf: u32, columns: u32, rows: u32, begin: f32, lines: RowBounds) {
    let at = params.wide_lanes + 2u * leaf;
    pixel_coverage[at] = vec4<u32>(columns, rows, bitcast<u32>(begin), bitcast<u32>(lines.third.at));
    pixel_coverage[at + 1u] = vec4<u32>(
        bitcast<u32>(lines.begin.at), bitcast<u32>(lines.end.at),
        pack_halves(lines.begin.slope, lines.end.slope), pack_halves(lines.third.slope, lines.third.side),
    );
}

// Projects the own box, without edges.
@if(MOLLER_TRUMBORE || WOOP)
fn project_triangle(leaf: u32, origin: vec3<f32>, max_distance: f32) {
    let coverage = project_own_box(leaf, origin, max_distance);
    write_triangle(leaf, coverage.columns, coverage.rows, bitcast<f32>(coverage.begin), no_lines());
}

@else
fn project_triangle(leaf: u32, origin: vec3<f32>, max_distance: f32) {
    let first = records[3u * leaf];
    let x = bitcast<vec3<f32>>(first.xyz) - origin.x;
    let y = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz) - origin.y;
    let z = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz) - origin.z;
    let depths = params.depth.x * x + params.depth.y * y + params.depth.z * z;
    let is_behind = is_triangle_behind(x, y, z, depths, max_distance);
    if is_unhittable(leaf) || is_behind {
        write_triangle(leaf, EMPTY_SPAN, EMPTY_SPAN, 0.0, no_lines());
        return;
    }
    let inverse = 1.0 / depths;
    let across = loose_project(params.column, x, y, z, inverse, max_distance);
    let down = loose_project(params.row, x, y, z, inverse, max_distance);
    @if(EXACT) let depth = min_component(depths);
    @else let depth = min_box_depth(own_box_of(x, y, z));
    let begin = nearest_depth(depth, max_distance);
    if !(min_component(depths) > near_limit(max_distance) && is_precise(across) && is_precise(down)) {
        let all = select(FULL_SPAN, EMPTY_SPAN, is_triangle_outside(x, y, z, depths, max_distance));
        write_triangle(leaf, all, all, select(0.0, begin, max_distance < MAX_DISTANCE), no_lines());
        return;
    }
    let columns = loose_pixel_span(min_component(across.at - across.error_bound), max_component(across.at + across.error_bound));
    let rows = loose_pixel_span(min_component(down.at - down.error_bound), max_component(down.at + down.error_bound));
    write_triangle(leaf, columns, rows, begin, loose_lines(across, down, f32(rows & 0xffffu)));
}

fn project_lane(lane: u32, origin: vec3<f32>, max_distance: f32) {
    let row = topology[params.wide_at + lane];
    let child = topology[params.wide_at + params.wide_lanes + lane];
    let low = bitcast<vec3<f32>>(nodes[row].xyz);
    let high = bitcast<vec3<f32>>(nodes[row + 1u].xyz);
    var coverage = NO_COVERAGE;
    // An empty subtree contains no triangle that a ray can hit.
    if low.x <= high.x { coverage = project_box(low - origin, high - origin, max_distance); }
    pixel_coverage[lane] = vec4<u32>(coverage.columns, coverage.rows, coverage.begin, child);
}

// Variants: intersector.
@compute @workgroup_size(128)
fn project(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = element_index(id, groups, 128u);
    if i >= params.count { return; }
    let origin = eye();
    let max_distance = root_relative_to(origin).max_distance;
    if i < params.wide_lanes {
        project_lane(i, origin, max_distance);
    } else {
        project_triangle(i - params.wide_lanes, origin, max_distance);
    }
}
