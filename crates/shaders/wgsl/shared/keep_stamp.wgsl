// How a workgroup keeps stamps. Who uses it declares `covers` and `counts`; all of a workgroup call these functions together.

var<workgroup> made: atomic<u32>;
var<workgroup> first_of_all: u32;
var<workgroup> stamped: atomic<u32>;

fn keep_stamp(at: u32, leaf: u32, corner: vec2<i32>, pixels: u32) {
    covers[LISTED + at] = vec4<u32>(leaf, u32(corner.x) | (u32(corner.y) << 16u), pixels, 0u);
}

// Where stamps of a workgroup begin, and where those of an invocation do.
struct Place { first: u32, own: u32 }

fn place_stamps(own: u32, local: u32) -> Place {
    if local == 0u { atomicStore(&made, 0u); }
    workgroupBarrier();
    var at = 0u;
    if own > 0u { at = atomicAdd(&made, own); }
    workgroupBarrier();
    if local == 0u { first_of_all = atomicAdd(&counts[STAMP_COUNT], atomicLoad(&made)); }
    let first = workgroupUniformLoad(&first_of_all);
    return Place(first, first + at);
}

// Counts the pixels of an invocation's stamps.
fn count_stamped(own: u32, local: u32) {
    if local == 0u { atomicStore(&stamped, 0u); }
    workgroupBarrier();
    if own > 0u { atomicAdd(&stamped, own); }
    workgroupBarrier();
    if local == 0u { atomicAdd(&counts[STAMPED_COUNT], atomicLoad(&stamped)); }
}
