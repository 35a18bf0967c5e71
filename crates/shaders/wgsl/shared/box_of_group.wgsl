// The box round what a workgroup of 256 holds.

var<workgroup> lows: array<vec3<f32>, 256>;
var<workgroup> highs: array<vec3<f32>, 256>;

// Leaves the box in lows[0] and highs[0], for every invocation to read.
// Every invocation must call it, in uniform control flow.
fn gather_box(local: u32, low: vec3<f32>, high: vec3<f32>) {
    lows[local] = low;
    highs[local] = high;
    workgroupBarrier();
    for (var half = 128u; half > 0u; half >>= 1u) {
        if local < half {
            lows[local] = min(lows[local], lows[local + half]);
            highs[local] = max(highs[local], highs[local + half]);
        }
        workgroupBarrier();
    }
}
