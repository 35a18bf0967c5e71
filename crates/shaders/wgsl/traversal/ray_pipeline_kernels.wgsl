// Compute kernels that support the ray-tracing pipeline: they prepare triangles for the driver's tree, and count hits
// and shadows.

import package::geometry::triangle::corner;
import package::geometry::units::is_finite;
import package::lib::buffers::counts;
import package::lib::params::{element_index, params};

@group(0) @binding(next) var<storage, read_write> finite_triangles: array<u32>;

// Writes triangles for the driver's tree, three vertices each. A triangle with a corner that is not finite collapses to
// a point (`eye`), where no ray hits it. Drivers also support inactive triangles. But an update must not activate or
// deactivate triangles, and Mesa 25.0 loses triangles next to inactive ones.

fn store_point(at: u32, v: vec3<u32>) {
    finite_triangles[at] = v.x;
    finite_triangles[at + 1u] = v.y;
    finite_triangles[at + 2u] = v.z;
}

@compute @workgroup_size(128)
fn collapse_non_finite(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let triangle = element_index(id, groups, 128u);
    if triangle >= params.count { return; }
    let a = corner(triangle, 0u);
    let b = corner(triangle, 1u);
    let c = corner(triangle, 2u);
    let is_hittable = is_finite(a) && is_finite(b) && is_finite(c);
    let point = bitcast<vec3<u32>>(params.eye);
    store_point(9u * triangle, select(point, a, is_hittable));
    store_point(9u * triangle + 3u, select(point, b, is_hittable));
    store_point(9u * triangle + 6u, select(point, c, is_hittable));
}

// Results of rays, `words` words each.
@group(0) @binding(next) var<storage, read> answers: array<u32>;

var<workgroup> sum: atomic<u32>;

// Counts the rays whose result is not a miss, with one atomic addition per workgroup, so that the trace itself need not count.
// See AnswerParams in lib/params.wgsl.

// Parameters: answer.
@compute @workgroup_size(128)
fn count_answers(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if local == 0u { atomicStore(&sum, 0u); }
    workgroupBarrier();
    let i = element_index(id, groups, 128u);
    if i < params.count {
        if answers[i * params.answer.words + params.answer.word] != params.answer.miss { atomicAdd(&sum, 1u); }
    }
    workgroupBarrier();
    if local == 0u { atomicAdd(&counts[params.answer.counter], atomicLoad(&sum)); }
}
