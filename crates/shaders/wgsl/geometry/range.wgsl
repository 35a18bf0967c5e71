// How far the coordinates of a key frame reach, where the host did not look: geom::Range, to the same bits.

import package::geometry::units::{scale_bits, starts_beyond};
import package::lib::buffers::{counts, range};
import package::lib::params::{element, params};

@group(0) @binding(next) var<storage, read> earlier: array<u32>;

// What lies in `range`. All sizes are bits of floats, which are in order as whole numbers.

// Whether all rays are extreme, and whether those are that start near the origin.
const EXTREME: u32 = 0u;
const TINY: u32 = 1u;
// The largest finite coordinate, how many vertices are near the origin without being it, and workgroups that are done; 0 after
// the last.
const LARGEST: u32 = 2u;
const NEAR: u32 = 3u;
const DONE: u32 = 4u;
// The sizes of some vertices.
const SAMPLES: u32 = 8u;

// Whether a ray that starts there, in scaled units, is extreme.
@if(!measure_range)
fn is_measured_extreme(origin: vec3<f32>) -> bool {
    return range[EXTREME] != 0u || starts_beyond(origin, range[TINY] != 0u);
}

// Whether other rays are than where nothing special is known.
@if(extreme_rays)
fn is_measured_unusual() -> bool { return (range[EXTREME] | range[TINY]) != 0u; }

// Where `counts` has 2 if sizes differ so much that boxes are padded by their own distance, else 1: a hint for later submissions.
const SPREAD_AT: u32 = 17u;
const INFINITE: u32 = 0x7f800000u;
// 1.0
const ONE: u32 = 0x3f800000u;
// Samples of an invocation of the last workgroup: 4096 in all.
const SHARE: u32 = 32u;

var<workgroup> group_largest: atomic<u32>;
var<workgroup> group_near: atomic<u32>;
var<workgroup> groups_done: u32;
// Samples that say anything, and those of them that are far smaller than the largest coordinate.
var<workgroup> telling: atomic<u32>;
var<workgroup> small: atomic<u32>;

// A power of two times a size in scaled units, in the scene's units.
fn in_scene(size: u32, exponent: i32) -> u32 { return bitcast<u32>(scale_bits(size, params.scale_exponent + exponent)); }

fn finite_or_zero(size: u32) -> u32 { return select(0u, size, size < INFINITE); }

// Takes a vertex into account.
fn measure(vertex: u32) {
    let at = 3u * vertex;
    let x = earlier[at] & 0x7fffffffu;
    let y = earlier[at + 1u] & 0x7fffffffu;
    let z = earlier[at + 2u] & 0x7fffffffu;
    let size = max(x, max(y, z));
    atomicMax(&group_largest, max(finite_or_zero(x), max(finite_or_zero(y), finite_or_zero(z))));
    // 2^-32
    if size > 0u && size < in_scene(ONE, -32) { atomicAdd(&group_near, 1u); }
    // One that says nothing counts as infinite.
    if vertex % params.first == 0u { atomicStore(&range[SAMPLES + vertex / params.first], select(INFINITE, size, size > 0u)); }
}

// Whether a coordinate is more than 2^10 times the lower quartile of the samples that say anything: as much more than more
// samples than are below the quartile.
fn is_spread(local: u32, largest: u32) -> bool {
    var own: array<u32, SHARE>;
    let count = (params.count + params.first - 1u) / params.first;
    for (var i = 0u; i < SHARE; i += 1u) {
        let sample = i * 128u + local;
        own[i] = INFINITE;
        if sample < count { own[i] = atomicLoad(&range[SAMPLES + sample]); }
    }
    var counts = vec2<u32>(0u);
    for (var i = 0u; i < SHARE; i += 1u) {
        if own[i] < INFINITE { counts += vec2<u32>(1u, u32(largest > bitcast<u32>(scale_bits(own[i], 10)))); }
    }
    atomicAdd(&telling, counts.x);
    atomicAdd(&small, counts.y);
    workgroupBarrier();
    return atomicLoad(&small) > atomicLoad(&telling) / 4u;
}

// What all vertices come to.
fn judge(local: u32) {
    let largest = atomicLoad(&range[LARGEST]);
    let spread = is_spread(local, largest);
    if local != 0u { return; }
    atomicStore(&counts[SPREAD_AT], select(1u, 2u, spread));
    atomicStore(&range[EXTREME], u32(largest > in_scene(ONE, 40)));
    atomicStore(&range[TINY], u32(atomicLoad(&range[NEAR]) >= 2u));
    atomicStore(&range[LARGEST], 0u);
    atomicStore(&range[NEAR], 0u);
    atomicStore(&range[DONE], 0u);
}

// A vertex an invocation; the workgroup that is done last judges.

@compute @workgroup_size(128)
fn measure_range(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if local == 0u {
        atomicStore(&group_largest, 0u);
        atomicStore(&group_near, 0u);
        atomicStore(&telling, 0u);
        atomicStore(&small, 0u);
    }
    workgroupBarrier();
    let vertex = element(id, groups, 128u);
    if vertex < params.count { measure(vertex); }
    workgroupBarrier();
    if local == 0u {
        atomicMax(&range[LARGEST], atomicLoad(&group_largest));
        atomicAdd(&range[NEAR], atomicLoad(&group_near));
    }
    storageBarrier();
    if local == 0u { groups_done = 1u + atomicAdd(&range[DONE], 1u); }
    if workgroupUniformLoad(&groups_done) < groups.x * groups.y { return; }
    storageBarrier();
    judge(local);
}
