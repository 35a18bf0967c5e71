// Radix sort of keys with eight bits per pass: count, scan, scatter.

import package::lib::params::params;

@if(sort_count)
@group(0) @binding(next) var<storage, read> keys: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> keys: array<u32>;

@group(0) @binding(next) var<storage, read_write> sorted: array<u32>;

// For each value of the digit, its number of occurrences in each tile. `sort_scan` replaces them by prefix sums, and
// appends the total of each value.
@if(sort_scatter)
@group(0) @binding(next) var<storage, read> digits: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> digits: array<u32>;

// Number of elements that one workgroup sorts: 8 per invocation.
const TILE: u32 = 2048u;

var<workgroup> sums: array<u32, 256>;

// Returns the inclusive prefix sum of `x` (Hillis, Steele 1986). sums[255] holds the total until the next call. Must be called by
// all invocations, in uniform control flow.
fn group_inclusive_scan(local: u32, x: u32) -> u32 {
    workgroupBarrier();
    sums[local] = x;
    workgroupBarrier();
    for (var step = 1u; step < 256u; step <<= 1u) {
        var sum = sums[local];
        if local >= step { sum += sums[local - step]; }
        workgroupBarrier();
        sums[local] = sum;
        workgroupBarrier();
    }
    return sums[local];
}

fn tiles_of(count: u32) -> u32 { return (count + TILE - 1u) / TILE; }

fn digit_of(key: u32) -> u32 { return (key >> params.sort.shift) & 255u; }

// Radix sort, first step of a digit: counts each value in each tile.

var<workgroup> digit_counts: array<atomic<u32>, 256>;

// Parameters: sort.
@compute @workgroup_size(256)
fn sort_count(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = group.x + group.y * groups.x;
    let tiles = tiles_of(params.count);
    atomicStore(&digit_counts[local], 0u);
    workgroupBarrier();
    for (var batch = 0u; batch < 8u; batch += 1u) {
        let i = tile * TILE + batch * 256u + local;
        if i < params.count { atomicAdd(&digit_counts[digit_of(keys[params.sort.source_at + i])], 1u); }
    }
    workgroupBarrier();
    if tile < tiles { digits[local * tiles + tile] = atomicLoad(&digit_counts[local]); }
}

// Radix sort, second step of a digit: one workgroup per value computes how often it occurs in the tiles before each tile, and in
// total.

// Parameters: sort.
@compute @workgroup_size(256)
fn sort_scan(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let tiles = tiles_of(params.count);
    let row = group.x * tiles;
    var before = 0u;
    for (var first = 0u; first < tiles; first += 256u) {
        let tile = first + local;
        var count = 0u;
        if tile < tiles { count = digits[row + tile]; }
        let sum = group_inclusive_scan(local, count);
        if tile < tiles { digits[row + tile] = before + sum - count; }
        before += sums[255];
    }
    if local == 0u { digits[256u * tiles + group.x] = before; }
}

// Radix sort, third step of a digit: writes each element to its place. The sort is stable, so that the order
// by earlier digits remains.

// Place of the next element of each value.
var<workgroup> next_places: array<u32, 256>;
// The invocations that hold each value: word 256 w + v has one bit for each of the 32 invocations from 32 w on.
var<workgroup> holders: array<atomic<u32>, 2048>;

// Returns the number of invocations before this one that hold the same value.
fn holders_before(local: u32, digit: u32) -> u32 {
    let word = local >> 5u;
    let own = atomicLoad(&holders[256u * word + digit]);
    var count = countOneBits(own & ((1u << (local & 31u)) - 1u));
    for (var w = 0u; w < word; w += 1u) { count += countOneBits(atomicLoad(&holders[256u * w + digit])); }
    return count;
}

// Counts the holders of one value and clears them.
fn count_and_clear_holders(digit: u32) -> u32 {
    var count = 0u;
    for (var w = 0u; w < 8u; w += 1u) {
        count += countOneBits(atomicLoad(&holders[256u * w + digit]));
        atomicStore(&holders[256u * w + digit], 0u);
    }
    return count;
}

// Parameters: sort.
@compute @workgroup_size(256)
fn sort_scatter(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = group.x + group.y * groups.x;
    let tiles = tiles_of(params.count);
    let total = digits[256u * tiles + local];
    let smaller = group_inclusive_scan(local, total) - total;
    next_places[local] = smaller + digits[local * tiles + min(tile, tiles - 1u)];
    for (var w = 0u; w < 8u; w += 1u) { atomicStore(&holders[256u * w + local], 0u); }
    workgroupBarrier();
    for (var batch = 0u; batch < 8u; batch += 1u) {
        let i = tile * TILE + batch * 256u + local;
        var key = 0u;
        if i < params.count {
            key = keys[params.sort.source_at + i];
            atomicOr(&holders[256u * (local >> 5u) + digit_of(key)], 1u << (local & 31u));
        }
        workgroupBarrier();
        if i < params.count {
            let place = params.sort.target_at + next_places[digit_of(key)] + holders_before(local, digit_of(key));
            keys[place] = key;
            sorted[place] = sorted[params.sort.source_at + i];
        }
        workgroupBarrier();
        next_places[local] += count_and_clear_holders(local);
        workgroupBarrier();
    }
}
