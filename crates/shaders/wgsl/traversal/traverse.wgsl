// Traversal of the tree for the closest hit and for any hit.

import package::geometry::node::{LEAF, NO_NODE, child_row, first_triangle_of, second_triangle_of};
import package::geometry::ray::{PreparedRay, loose_planes, loose_slab};
import package::intersect::intersector::{BestHit, initial_best, intersect_leaf_any, intersect_leaf_closest, search_limit};
import package::lib::buffers::nodes;

// Returns where a ray enters and leaves a node's box before `bound`. The box is met if x <= y. Requires that t_min is not
// negative. Compares bits as integers: non-negative floats compare as their bits do, and negative ones
// stay below t_min in any order. Devices find the greatest of three integers in one instruction
// (an H200: rays 4 % faster).

@if(!(trace_rays || any_rays || MODULE))
fn slab_interval(ray: PreparedRay, low: vec4<u32>, high: vec4<u32>, bound: f32) -> vec2<i32> {
    let planes = loose_planes(ray, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
    let n = bitcast<vec3<i32>>(planes.near);
    let f = bitcast<vec3<i32>>(planes.far);
    return vec2<i32>(
        max(max(max(n.x, n.y), n.z), bitcast<i32>(ray.t_min)),
        min(min(min(f.x, f.y), f.z), bitcast<i32>(bound)),
    );
}

// The same for rays whose t_min may be negative.
@else
fn slab_interval(ray: PreparedRay, low: vec4<u32>, high: vec4<u32>, bound: f32) -> vec2<f32> {
    let s = loose_slab(ray, bitcast<vec3<f32>>(low.xyz), bitcast<vec3<f32>>(high.xyz));
    return vec2<f32>(max(s.x, ray.t_min), min(s.y, bound));
}

// Closest-hit search. The intersector defines `BestHit`.

// Descends one node. If both children are met, pushes the farther one.
fn traverse_node(ray: PreparedRay, node: u32, limit: f32, stack: ptr<function, array<u32, 64>>, depth: ptr<function, u32>) -> u32 {
    let row = child_row(node);
    let left_row = nodes[row];
    let right_row = nodes[row + 2u];
    let left = slab_interval(ray, left_row, nodes[row + 1u], limit);
    let right = slab_interval(ray, right_row, nodes[row + 3u], limit);
    let hits_left = left.x <= left.y;
    let hits_right = right.x <= right.y;
    if hits_left && hits_right {
        let right_first = right.x < left.x;
        (*stack)[*depth] = select(right_row.w, left_row.w, right_first);
        *depth += 1u;
        return select(left_row.w, right_row.w, right_first);
    }
    return select(select(NO_NODE, right_row.w, hits_right), left_row.w, hits_left);
}

// Each iteration of this loop visits at most two nodes and one triangle. A loop whose iterations visit either a node or a
// triangle (Aila, Laine 2009: "if-if") was a tenth slower. Descending to a leaf before any triangle test was slower still.
fn find_closest(ray: PreparedRay) -> BestHit {
    var best = initial_best(ray);
    var stack: array<u32, 64>;
    var depth = 0u;
    var node = nodes[0].w;
    let root = slab_interval(ray, nodes[0], nodes[1], search_limit(best));
    if !(root.x <= root.y) { return best; }
    loop {
        if (node & LEAF) == 0u {
            node = traverse_node(ray, node, search_limit(best), &stack, &depth);
            if (node & LEAF) == 0u { node = traverse_node(ray, node, search_limit(best), &stack, &depth); }
        }
        if (node & LEAF) != 0u {
            if node != NO_NODE {
                best = intersect_leaf_closest(ray, first_triangle_of(node), best);
                node = second_triangle_of(node);
            }
            if node == NO_NODE {
                if depth == 0u { break; }
                depth -= 1u;
                node = stack[depth];
            }
        }
    }
    return best;
}

// An iteration of the any-hit search visits up to three nodes and both triangles of a leaf: see docs/design/visibility-buffer.md.
@if(resolve)
const TESTS_LEAF_PAIRS: bool = true;

// An iteration of the any-hit search visits up to two nodes and one triangle.
@else
const TESTS_LEAF_PAIRS: bool = false;

// Any-hit search, which ends at the first hit of a triangle other than `ignore`.

// Descends one node. If both children are met, pushes the second one.
fn push_children(ray: PreparedRay, node: u32, stack: ptr<function, array<u32, 64>>, depth: ptr<function, u32>) -> u32 {
    let row = child_row(node);
    let left_row = nodes[row];
    let right_row = nodes[row + 2u];
    let left = slab_interval(ray, left_row, nodes[row + 1u], ray.t_max);
    let right = slab_interval(ray, right_row, nodes[row + 3u], ray.t_max);
    let hits_left = left.x <= left.y;
    let hits_right = right.x <= right.y;
    if hits_left && hits_right {
        (*stack)[*depth] = right_row.w;
        *depth += 1u;
    }
    return select(select(NO_NODE, right_row.w, hits_right), left_row.w, hits_left);
}

fn find_any(ray: PreparedRay, ignore: u32) -> bool {
    var stack: array<u32, 64>;
    var depth = 0u;
    var node = nodes[0].w;
    let root = slab_interval(ray, nodes[0], nodes[1], ray.t_max);
    if !(root.x <= root.y) { return false; }
    loop {
        if (node & LEAF) == 0u {
            node = push_children(ray, node, &stack, &depth);
            if (node & LEAF) == 0u {
                node = push_children(ray, node, &stack, &depth);
                if TESTS_LEAF_PAIRS && (node & LEAF) == 0u { node = push_children(ray, node, &stack, &depth); }
            }
        }
        if (node & LEAF) != 0u {
            if node != NO_NODE {
                if intersect_leaf_any(ray, first_triangle_of(node), ignore) { return true; }
                node = second_triangle_of(node);
                if TESTS_LEAF_PAIRS && node != NO_NODE {
                    if intersect_leaf_any(ray, first_triangle_of(node), ignore) { return true; }
                }
            }
            if TESTS_LEAF_PAIRS || node == NO_NODE {
                if depth == 0u { break; }
                depth -= 1u;
                node = stack[depth];
            }
        }
    }
    return false;
}
