//! use params scan
// Radix sort, first step of a digit: how often each value occurs in each tile.

@group(0) @binding(1) var<storage, read> keys: array<u32>;
// For each value of the digit, a count for each tile; after those, the sums that sort_scan makes.
@group(0) @binding(2) var<storage, read_write> digits: array<u32>;

var<workgroup> tally: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn sort_count(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = group.x + group.y * groups.x;
    let tiles = tiles_of(params.count);
    atomicStore(&tally[local], 0u);
    workgroupBarrier();
    for (var turn = 0u; turn < 8u; turn += 1u) {
        let i = tile * TILE + turn * 256u + local;
        if i < params.count { atomicAdd(&tally[digit_of(keys[params.first + i])], 1u); }
    }
    workgroupBarrier();
    if tile < tiles { digits[local * tiles + tile] = atomicLoad(&tally[local]); }
}
