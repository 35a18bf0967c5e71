// Measures the range of a key frame's coordinates where the host has not. The results equal those of
// geom::CoordinateRange. Only the host computes `clearance`.

import package::geometry::units::{has_extreme_origin, scale_bits};
import package::lib::buffers::{counts, range};
import package::lib::counters::SIZE_SPREAD;
import package::lib::params::{element_index, params};

// The vertices of the key frame, in scene units.
@group(0) @binding(next) var<storage, read> earlier: array<u32>;

// Words of `range`. All sizes are bits of floats, which are ordered as integers.

// Whether all rays are extreme, and whether rays that start near the origin are.
const EXTREME: u32 = 0u;
const TINY: u32 = 1u;
// The largest finite coordinate, the number of vertices near the origin but not at it, and the number of finished workgroups.
// The last workgroup resets them to 0.
const LARGEST: u32 = 2u;
const NEAR_ORIGIN: u32 = 3u;
const FINISHED_GROUPS: u32 = 4u;
// The sizes of sampled vertices.
const SAMPLES: u32 = 8u;

// Returns whether a ray from `origin`, in scaled units, is extreme.
@if(!measure_range)
fn is_measured_extreme(origin: vec3<f32>) -> bool {
    return range[EXTREME] != 0u || has_extreme_origin(origin, range[TINY] != 0u);
}

// Returns whether the measured range makes rays extreme that their origins alone would not.
@if(extreme_rays)
fn makes_rays_extreme() -> bool { return (range[EXTREME] | range[TINY]) != 0u; }

const INFINITE: u32 = 0x7f800000u;
// 1.0
const ONE: u32 = 0x3f800000u;
// Number of samples per invocation of the last workgroup: 4096 in all.
const SAMPLES_PER_INVOCATION: u32 = 32u;

var<workgroup> group_largest: atomic<u32>;
var<workgroup> group_near: atomic<u32>;
var<workgroup> finished_groups: u32;
// Number of valid samples, and number of samples that are far smaller than the largest coordinate.
var<workgroup> valid_samples: atomic<u32>;
var<workgroup> small_samples: atomic<u32>;

// Converts size * 2^exponent from scaled units to scene units.
fn in_scene_units(size: u32, exponent: i32) -> u32 { return bitcast<u32>(scale_bits(size, params.scale_exponent + exponent)); }

fn finite_or_zero(size: u32) -> u32 { return select(0u, size, size < INFINITE); }

// Adds a vertex to the workgroup's results.
fn measure(vertex: u32) {
    let at = 3u * vertex;
    let x = earlier[at] & 0x7fffffffu;
    let y = earlier[at + 1u] & 0x7fffffffu;
    let z = earlier[at + 2u] & 0x7fffffffu;
    let size = max(x, max(y, z));
    atomicMax(&group_largest, max(finite_or_zero(x), max(finite_or_zero(y), finite_or_zero(z))));
    // 2^-32
    if size > 0u && size < in_scene_units(ONE, -32) { atomicAdd(&group_near, 1u); }
    // A sample at the origin is not valid and is stored as infinite.
    if vertex % params.measure.sample_step == 0u {
        atomicStore(&range[SAMPLES + vertex / params.measure.sample_step], select(INFINITE, size, size > 0u));
    }
}

// Returns whether the largest coordinate exceeds 2^10 times the lower quartile of the valid samples. It does if it exceeds 2^10
// times the size of more than a quarter of the samples.
fn is_spread(local: u32, largest: u32) -> bool {
    var samples: array<u32, SAMPLES_PER_INVOCATION>;
    let count = (params.count + params.measure.sample_step - 1u) / params.measure.sample_step;
    for (var i = 0u; i < SAMPLES_PER_INVOCATION; i += 1u) {
        let index = i * 128u + local;
        samples[i] = INFINITE;
        if index < count { samples[i] = atomicLoad(&range[SAMPLES + index]); }
    }
    var sample_counts = vec2<u32>(0u);
    for (var i = 0u; i < SAMPLES_PER_INVOCATION; i += 1u) {
        if samples[i] < INFINITE { sample_counts += vec2<u32>(1u, u32(largest > bitcast<u32>(scale_bits(samples[i], 10)))); }
    }
    atomicAdd(&valid_samples, sample_counts.x);
    atomicAdd(&small_samples, sample_counts.y);
    workgroupBarrier();
    return atomicLoad(&small_samples) > atomicLoad(&valid_samples) / 4u;
}

// Writes the range of all vertices.
fn write_range(local: u32) {
    let largest = atomicLoad(&range[LARGEST]);
    let spread = is_spread(local, largest);
    if local != 0u { return; }
    atomicStore(&counts[SIZE_SPREAD], select(1u, 2u, spread));
    atomicStore(&range[EXTREME], u32(largest > in_scene_units(ONE, 40)));
    atomicStore(&range[TINY], u32(atomicLoad(&range[NEAR_ORIGIN]) >= 2u));
    atomicStore(&range[LARGEST], 0u);
    atomicStore(&range[NEAR_ORIGIN], 0u);
    atomicStore(&range[FINISHED_GROUPS], 0u);
}

// One vertex per invocation. The workgroup that finishes last writes the results.

// Parameters: measure.
@compute @workgroup_size(128)
fn measure_range(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if local == 0u {
        atomicStore(&group_largest, 0u);
        atomicStore(&group_near, 0u);
        atomicStore(&valid_samples, 0u);
        atomicStore(&small_samples, 0u);
    }
    workgroupBarrier();
    let vertex = element_index(id, groups, 128u);
    if vertex < params.count { measure(vertex); }
    workgroupBarrier();
    if local == 0u {
        atomicMax(&range[LARGEST], atomicLoad(&group_largest));
        atomicAdd(&range[NEAR_ORIGIN], atomicLoad(&group_near));
    }
    storageBarrier();
    if local == 0u { finished_groups = 1u + atomicAdd(&range[FINISHED_GROUPS], 1u); }
    if workgroupUniformLoad(&finished_groups) < groups.x * groups.y { return; }
    storageBarrier();
    write_range(local);
}
