// Sums over a workgroup of 256, and where the parts of a radix sort lie.

// Elements that one workgroup sorts: 8 an invocation.
const TILE: u32 = 2048u;

var<workgroup> sums: array<u32, 256>;

// The sum of `x` over all invocations up to and including this one (Hillis, Steele 1986).
// sums[255] holds the sum of all until the next call. Every invocation must call it, in uniform control flow.
fn scan_group(local: u32, x: u32) -> u32 {
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

fn digit_of(key: u32) -> u32 { return (key >> params.shift) & 255u; }
