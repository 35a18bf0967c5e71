//! use params scan
// Radix sort, second step of a digit: for each of its values (a workgroup each),
// how often it occurs in the tiles before each tile, and in all.

@group(0) @binding(1) var<storage, read_write> digits: array<u32>;

@compute @workgroup_size(256)
fn sort_scan(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>) {
    let tiles = tiles_of(params.count);
    let row = group.x * tiles;
    var before = 0u;
    for (var first = 0u; first < tiles; first += 256u) {
        let tile = first + local;
        var count = 0u;
        if tile < tiles { count = digits[row + tile]; }
        let sum = scan_group(local, count);
        if tile < tiles { digits[row + tile] = before + sum - count; }
        before += sums[255];
    }
    if local == 0u { digits[256u * tiles + group.x] = before; }
}
