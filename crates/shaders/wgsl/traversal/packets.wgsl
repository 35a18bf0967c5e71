// Kernels that trace packets of rays.

import package::geometry::queries::{camera_ray, eye, is_untraceable, pixel_direction};
import package::geometry::ray::{PreparedRay, root_relative_to};
import package::intersect::intersector::{BestHit, initial_best, intersect_leaf_closest, search_limit};
import package::lib::buffers::covers;
import package::lib::lanes::{group_any, group_max, group_min, group_shuffle, transpose_bits};
import package::lib::params::params;
import package::traversal::finish::{finish_miss, finish_ray};
import package::visibility::outline::{BLOCK, BOUNDLESS};

// A packet covers 8 x 4 pixels. Its rays, one per invocation, traverse the wide tree together: see docs/design/packets.md.
// Coverage decides which triangles are tested, never which one is hit. All 32 invocations must call these functions together.

// In place of a lane that was already visited. Greater than all depths.
const DONE: u32 = 0xffffffffu;
// Greater than every finite depth.
const FARTHEST_DEPTH: u32 = 0x7f800000u;

// Returns whether a projected box or triangle overlaps the packet and begins before a depth, as bits.
fn meets_tile(c: vec4<u32>, corner: vec2<u32>, depth: u32) -> bool {
    let first = c.xy & vec2<u32>(0xffffu);
    let last = c.xy >> vec2<u32>(16u);
    return all(first <= corner + vec2<u32>(7u, 3u)) && all(last >= corner) && c.z <= depth;
}

// Returns the key by which lanes are visited: the nearest depth, with the lane's index in the lowest five bits.
fn place_of(c: vec4<u32>, is_there: bool, corner: vec2<u32>, depth: u32, lane: u32) -> u32 {
    return select(DONE, (c.z & 0x7fffffe0u) | lane, is_there && meets_tile(c, corner, depth));
}

// Returns the packet's pixels within a projected rectangle, one bit each, row by row.
fn pixels_within(c: vec4<u32>, corner: vec2<u32>) -> u32 {
    let first = max(c.xy & vec2<u32>(0xffffu), corner) - corner;
    let last = min((c.xy >> vec2<u32>(16u)) - corner, vec2<u32>(7u, 3u));
    let columns = ((2u << last.x) - (1u << first.x)) * 0x01010101u;
    return columns & (0xffffffffu << (8u * first.y)) & (0xffffffffu >> (24u - 8u * last.y));
}

// Returns the packet's pixels between a triangle's lines: see `RowBound` in project.wgsl.
fn pixels_between(c: vec4<u32>, lines: vec4<u32>, corner: vec2<u32>) -> u32 {
    let down = bitcast<i32>(corner.y - (c.y & 0xffffu));
    let left = bitcast<i32>(corner.x << 8u);
    let slope = vec3<i32>(bitcast<i32>(lines.z << 16u), bitcast<i32>(lines.z), bitcast<i32>(lines.w << 16u)) >> vec3<u32>(16u);
    let at = vec3<i32>(bitcast<i32>(lines.x), bitcast<i32>(lines.y), bitcast<i32>(c.w)) + slope * down - left;
    let side = bitcast<i32>(lines.w) >> 16u;
    // The third line bounds either side.
    var begin = vec2<i32>(at.x, select(-BOUNDLESS, at.z, side == -1));
    var end = vec2<i32>(at.y, select(BOUNDLESS, at.z, side == 1));
    let begin_slope = vec2<i32>(slope.x, select(0, slope.z, side == -1));
    let end_slope = vec2<i32>(slope.y, select(0, slope.z, side == 1));
    var pixels = 0u;
    for (var row = 0u; row < 32u; row += 8u) {
        let first = clamp(max(begin.x, begin.y) >> 8u, 0, 8);
        let last = clamp(min(end.x, end.y) >> 8u, -1, 7);
        pixels |= ((0xffu << u32(first)) & (0xffu >> u32(7 - last))) << row;
        begin += begin_slope;
        end += end_slope;
    }
    return pixels;
}

// Returns the packet's pixels that a triangle may cover before a depth.
fn pixels_of(leaf: u32, corner: vec2<u32>, depth: u32) -> u32 {
    let c = covers[params.wide_lanes + 2u * leaf];
    if !meets_tile(c, corner, depth) { return 0u; }
    return pixels_within(c, corner) & pixels_between(c, covers[params.wide_lanes + 2u * leaf + 1u], corner);
}

// Returns the factor from a ray's t to depths of the picture; infinity if it is out of range.
fn depth_a_unit(ray: PreparedRay) -> f32 {
    let shift = params.depth_exponent - params.scale_exponent - ray.exponent;
    if shift < 0 || shift > 100 { return bitcast<f32>(0x7f800000u | params.zero); }
    return bitcast<f32>(u32(127 + shift) << 23u);
}

// State of a search: a wide node, and for this invocation's lane its child and the key by which lanes are visited.
struct Lanes { node: u32, goal: u32, place: u32 }

fn row_of_lane(node: u32, lane: u32) -> u32 { return (node >> 6u) + min(lane, (node & 63u) - 1u); }

fn lanes_of(node: u32, corner: vec2<u32>, depth: u32, lane: u32) -> Lanes {
    let child = covers[row_of_lane(node, lane)];
    return Lanes(node, child.w, place_of(child, lane < (node & 63u), corner, depth, lane));
}

// Searches closest hits from the root's lanes on. Rays that are not `sought` find nothing.
fn find_together(root: Lanes, corner: vec2<u32>, lane: u32, sought: bool, ray: PreparedRay) -> BestHit {
    let depth_of_t = depth_a_unit(ray);
    var best = initial_best(ray);
    // Stack of the nodes above, with the keys of their remaining lanes.
    var places: array<u32, 16>;
    var nodes_above: array<u32, 16>;
    var level = 0u;
    var at = root;
    var depth = FARTHEST_DEPTH;
    loop {
        let least = group_min(at.place, lane);
        if (least & 0x7fffffe0u) > depth {
            if level == 0u { break; }
            level -= 1u;
            at.node = nodes_above[level];
            at.place = places[level];
            at.goal = covers[row_of_lane(at.node, lane)].w;
            continue;
        }
        if at.place == least { at.place = DONE; }
        let next = group_shuffle(at.goal, least & 31u, lane);
        if (next & BLOCK) == 0u {
            places[level] = at.place;
            nodes_above[level] = at.node;
            level += 1u;
            at = lanes_of(next, corner, depth, lane);
            continue;
        }
        let first = (next & ~BLOCK) >> 6u;
        var pixels = 0u;
        if lane < (next & 63u) { pixels = pixels_of(first + lane, corner, depth); }
        if !group_any(pixels != 0u, lane) { continue; }
        var left = transpose_bits(pixels, lane);
        if !sought { left = 0u; }
        while left != 0u {
            best = intersect_leaf_closest(ray, first + firstTrailingBit(left), best);
            left &= left - 1u;
        }
        depth = group_max(select(0u, bitcast<u32>(search_limit(best) * depth_of_t), sought), lane);
    }
    return best;
}

// Maps an invocation to a pixel of its packet.
fn pixel_in(lane: u32) -> vec2<u32> { return vec2<u32>(lane & 7u, lane >> 3u); }

// Does the same as `trace_and_shadow_camera`, for a packet.
fn trace_tile(packet: vec2<u32>, lane: u32) {
    let corner = packet * vec2<u32>(8u, 4u);
    let pixel = corner + pixel_in(lane);
    let is_there = pixel.x < params.width && pixel.y < params.height;
    let i = pixel.y * params.width + pixel.x;
    // Excludes most packets that see nothing, before their rays are generated.
    let root = lanes_of(params.wide_root, corner, FARTHEST_DEPTH, lane);
    if !group_any(root.place != DONE, lane) {
        if is_there { finish_miss(i); }
        return;
    }
    let direction = pixel_direction(pixel);
    let origin = eye();
    let sought = is_there && !is_untraceable(direction, origin);
    let ray = camera_ray(direction, origin, root_relative_to(origin));
    let best = find_together(root, corner, lane, sought, ray);
    if is_there { finish_ray(i, ray, best, origin); }
}

// Closest hits of a camera's rays and their shadow rays, packet by packet. Each workgroup is a packet.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(32)
fn trace_packets(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_tile(group.xy, lane);
}

// Closest hits of a camera's rays and their shadow rays, packet by packet. Each subgroup of 32 is a packet, and a
// workgroup has four.
//
// Variants: intersector, arithmetic, subgroups.
// Parameters: search.
@compute @workgroup_size(128)
fn trace_packets_by_subgroups(@builtin(subgroup_invocation_id) lane: u32, @builtin(subgroup_id) packet: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_tile(2u * group.xy + vec2<u32>(packet & 1u, packet >> 1u), lane);
}
