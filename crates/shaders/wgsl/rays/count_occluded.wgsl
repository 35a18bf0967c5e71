//! use params
// How many rays are occluded, added to the count that `first` names: rays that met anything, or hits in shadow.

@group(0) @binding(1) var<storage, read> occluded: array<u32>;
@group(0) @binding(2) var<storage, read_write> counts: array<atomic<u32>>;

var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(128)
fn count_occluded(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if local == 0u { atomicStore(&sum, 0u); }
    workgroupBarrier();
    let i = element(id, groups, 128u);
    if i < params.count {
        if occluded[i] != 0u { atomicAdd(&sum, 1u); }
    }
    workgroupBarrier();
    if local == 0u { atomicAdd(&counts[params.first], atomicLoad(&sum)); }
}
