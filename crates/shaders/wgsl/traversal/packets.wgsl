// Kernels that trace camera rays in packets through the wide tree.

import package::geometry::queries::{camera_ray, eye, is_untraceable, pixel_direction};
import package::geometry::ray::{PreparedRay, root_relative_to};
import package::intersect::intersector::{BestHit, hit_of, initial_best, intersect_leaf_closest, search_limit};
import package::lib::buffers::pixel_coverage;
import package::lib::lanes::{group_any, group_max, group_min, group_shuffle, transpose_bits};
import package::lib::params::params;
import package::traversal::finish::{write_hit_and_shadow, write_miss};
import package::visibility::outline::{BLOCK, UNBOUNDED};

// A packet covers 8 x 4 pixels. Its rays, one per invocation, traverse the wide tree together: see docs/design/packets.md.
// Coverage decides which triangles are tested, never which one is hit. All 32 invocations must call these functions together.

// Key of a lane that was already visited, does not overlap the packet, or does not exist. Greater than all depths.
const SKIPPED: u32 = 0xffffffffu;
// Greater than every finite depth.
const FARTHEST_DEPTH: u32 = 0x7f800000u;

// Returns whether a projected box or triangle overlaps the packet and begins no farther than `depth` (bits of a float).
fn overlaps_packet(coverage: vec4<u32>, corner: vec2<u32>, depth: u32) -> bool {
    let first = coverage.xy & vec2<u32>(0xffffu);
    let last = coverage.xy >> vec2<u32>(16u);
    return all(first <= corner + vec2<u32>(7u, 3u)) && all(last >= corner) && coverage.z <= depth;
}

// Returns the key that orders visits to lanes: the nearest depth, with the lane's index in the lowest five bits.
fn visit_key(coverage: vec4<u32>, is_valid: bool, corner: vec2<u32>, depth: u32, lane: u32) -> u32 {
    return select(SKIPPED, (coverage.z & 0x7fffffe0u) | lane, is_valid && overlaps_packet(coverage, corner, depth));
}

// Returns the packet's pixels within a projected rectangle, one bit each, row by row.
fn pixels_within(coverage: vec4<u32>, corner: vec2<u32>) -> u32 {
    let first = max(coverage.xy & vec2<u32>(0xffffu), corner) - corner;
    let last = min((coverage.xy >> vec2<u32>(16u)) - corner, vec2<u32>(7u, 3u));
    let columns = ((2u << last.x) - (1u << first.x)) * 0x01010101u;
    return columns & (0xffffffffu << (8u * first.y)) & (0xffffffffu >> (24u - 8u * last.y));
}

// Returns the packet's pixels between a triangle's lines: see `RowBound` in project.wgsl.
fn pixels_between(coverage: vec4<u32>, lines: vec4<u32>, corner: vec2<u32>) -> u32 {
    let down = bitcast<i32>(corner.y - (coverage.y & 0xffffu));
    let left = bitcast<i32>(corner.x << 8u);
    let slope = vec3<i32>(bitcast<i32>(lines.z << 16u), bitcast<i32>(lines.z), bitcast<i32>(lines.w << 16u)) >> vec3<u32>(16u);
    let offset = vec3<i32>(bitcast<i32>(lines.x), bitcast<i32>(lines.y), bitcast<i32>(coverage.w)) + slope * down - left;
    let side = bitcast<i32>(lines.w) >> 16u;
    // The third line bounds either side.
    var begin = vec2<i32>(offset.x, select(-UNBOUNDED, offset.z, side == -1));
    var end = vec2<i32>(offset.y, select(UNBOUNDED, offset.z, side == 1));
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
fn covered_pixels(leaf: u32, corner: vec2<u32>, depth: u32) -> u32 {
    let coverage = pixel_coverage[params.wide_lanes + 2u * leaf];
    if !overlaps_packet(coverage, corner, depth) { return 0u; }
    let lines = pixel_coverage[params.wide_lanes + 2u * leaf + 1u];
    return pixels_within(coverage, corner) & pixels_between(coverage, lines, corner);
}

// Returns the factor from a ray's t to depths of the picture; infinity if it is out of range.
fn depth_per_t(ray: PreparedRay) -> f32 {
    let shift = params.depth_exponent - params.scale_exponent - ray.exponent;
    if shift < 0 || shift > 100 { return bitcast<f32>(0x7f800000u | params.zero); }
    return bitcast<f32>(u32(127 + shift) << 23u);
}

// State of a search: a wide node, and the child and visit key of this invocation's lane.
struct Lanes { node: u32, child: u32, key: u32 }

fn row_of_lane(node: u32, lane: u32) -> u32 { return (node >> 6u) + min(lane, (node & 63u) - 1u); }

fn load_lanes(node: u32, corner: vec2<u32>, depth: u32, lane: u32) -> Lanes {
    let child = pixel_coverage[row_of_lane(node, lane)];
    return Lanes(node, child.w, visit_key(child, lane < (node & 63u), corner, depth, lane));
}

// Returns the closest hits of a packet, from the root's lanes on. Inactive rays hit nothing.
fn find_closest_in_packet(root: Lanes, corner: vec2<u32>, lane: u32, is_active: bool, ray: PreparedRay) -> BestHit {
    let depth_of_t = depth_per_t(ray);
    var best = initial_best(ray);
    // Stack of the nodes above, with the keys of their remaining lanes.
    var key_stack: array<u32, 16>;
    var node_stack: array<u32, 16>;
    var stack_depth = 0u;
    var lanes = root;
    var max_depth = FARTHEST_DEPTH;
    loop {
        let nearest = group_min(lanes.key, lane);
        if (nearest & 0x7fffffe0u) > max_depth {
            if stack_depth == 0u { break; }
            stack_depth -= 1u;
            lanes.node = node_stack[stack_depth];
            lanes.key = key_stack[stack_depth];
            lanes.child = pixel_coverage[row_of_lane(lanes.node, lane)].w;
            continue;
        }
        if lanes.key == nearest { lanes.key = SKIPPED; }
        let child = group_shuffle(lanes.child, nearest & 31u, lane);
        if (child & BLOCK) == 0u {
            key_stack[stack_depth] = lanes.key;
            node_stack[stack_depth] = lanes.node;
            stack_depth += 1u;
            lanes = load_lanes(child, corner, max_depth, lane);
            continue;
        }
        let first_leaf = (child & ~BLOCK) >> 6u;
        var pixels = 0u;
        if lane < (child & 63u) { pixels = covered_pixels(first_leaf + lane, corner, max_depth); }
        if !group_any(pixels != 0u, lane) { continue; }
        var remaining = transpose_bits(pixels, lane);
        if !is_active { remaining = 0u; }
        while remaining != 0u {
            best = intersect_leaf_closest(ray, first_leaf + firstTrailingBit(remaining), best);
            remaining &= remaining - 1u;
        }
        max_depth = group_max(select(0u, bitcast<u32>(search_limit(best) * depth_of_t), is_active), lane);
    }
    return best;
}

// Maps an invocation to a pixel of its packet.
fn pixel_in(lane: u32) -> vec2<u32> { return vec2<u32>(lane & 7u, lane >> 3u); }

// Does the same as `trace_and_shadow_camera`, for a packet.
fn trace_packet(packet: vec2<u32>, lane: u32) {
    let corner = packet * vec2<u32>(8u, 4u);
    let pixel = corner + pixel_in(lane);
    let is_valid = pixel.x < params.width && pixel.y < params.height;
    let i = pixel.y * params.width + pixel.x;
    // Excludes most packets that see nothing, before their rays are generated.
    let root = load_lanes(params.wide_root, corner, FARTHEST_DEPTH, lane);
    if !group_any(root.key != SKIPPED, lane) {
        if is_valid { write_miss(i); }
        return;
    }
    let direction = pixel_direction(pixel);
    let origin = eye();
    let is_active = is_valid && !is_untraceable(direction, origin);
    let ray = camera_ray(direction, origin, root_relative_to(origin));
    let best = find_closest_in_packet(root, corner, lane, is_active, ray);
    if is_valid { write_hit_and_shadow(i, hit_of(i, ray, best), best, origin); }
}

// Closest hits of a camera's rays and their shadow rays, packet by packet. Each workgroup is a packet.
//
// Variants: intersector, arithmetic.
// Parameters: search.
@compute @workgroup_size(32)
fn trace_packets(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {
    trace_packet(group.xy, lane);
}

// Closest hits of a camera's rays and their shadow rays, packet by packet. Each subgroup of 32 is a packet, and a
// workgroup has four.
//
// Variants: intersector, arithmetic, subgroups.
// Parameters: search.
@compute @workgroup_size(128)
fn trace_packets_by_subgroups(
    @builtin(subgroup_invocation_id) lane: u32,
    @builtin(subgroup_id) packet: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    trace_packet(2u * group.xy + vec2<u32>(packet & 1u, packet >> 1u), lane);
}
