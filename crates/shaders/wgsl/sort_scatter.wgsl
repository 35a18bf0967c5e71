//! use params scan
// Radix sort, third step of a digit: each element goes to its place. Elements of
// the same digit keep their order, without which earlier digits would be lost.

@group(0) @binding(1) var<storage, read_write> keys: array<u32>;
@group(0) @binding(2) var<storage, read_write> sorted: array<u32>;
@group(0) @binding(3) var<storage, read> digits: array<u32>;

// Where the next element of each value goes.
var<workgroup> places: array<u32, 256>;
// Who holds which value: word 256 w + v has a bit for each of the invocations from 32 w on.
var<workgroup> holders: array<atomic<u32>, 2048>;

// How many invocations before this one hold the same value.
fn holders_before(local: u32, digit: u32) -> u32 {
    let word = local >> 5u;
    let own = atomicLoad(&holders[256u * word + digit]);
    var count = countOneBits(own & ((1u << (local & 31u)) - 1u));
    for (var w = 0u; w < word; w += 1u) { count += countOneBits(atomicLoad(&holders[256u * w + digit])); }
    return count;
}

// Counts the holders of one value and forgets them.
fn take_holders(digit: u32) -> u32 {
    var count = 0u;
    for (var w = 0u; w < 8u; w += 1u) {
        count += countOneBits(atomicLoad(&holders[256u * w + digit]));
        atomicStore(&holders[256u * w + digit], 0u);
    }
    return count;
}

@compute @workgroup_size(256)
fn sort_scatter(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = group.x + group.y * groups.x;
    let tiles = tiles_of(params.count);
    let total = digits[256u * tiles + local];
    let smaller = scan_group(local, total) - total;
    places[local] = smaller + digits[local * tiles + min(tile, tiles - 1u)];
    for (var w = 0u; w < 8u; w += 1u) { atomicStore(&holders[256u * w + local], 0u); }
    workgroupBarrier();
    for (var turn = 0u; turn < 8u; turn += 1u) {
        let i = tile * TILE + turn * 256u + local;
        var key = 0u;
        if i < params.count {
            key = keys[params.first + i];
            atomicOr(&holders[256u * (local >> 5u) + digit_of(key)], 1u << (local & 31u));
        }
        workgroupBarrier();
        if i < params.count {
            let place = params.destination + places[digit_of(key)] + holders_before(local, digit_of(key));
            keys[place] = key;
            sorted[place] = sorted[params.first + i];
        }
        workgroupBarrier();
        places[local] += take_holders(local);
        workgroupBarrier();
    }
}
