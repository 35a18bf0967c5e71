// How a workgroup keeps tiles and counts their tests. Who uses it declares `covers` and `counts`; all of a workgroup call
// `place_stamps` together.

var<workgroup> made: atomic<u32>;
var<workgroup> tests_of_all: atomic<u32>;
var<workgroup> first_of_all: u32;

fn keep_tile(at: u32, leaf: u32, corner: vec2<i32>, pixels: u32) {
    covers[LISTED + at] = vec4<u32>(leaf, u32(corner.x) | (u32(corner.y) << 16u), pixels, 0u);
}

// Where tiles of a workgroup begin, and where those of an invocation do.
struct Place { first: u32, own: u32 }

fn place_stamps(own: u32, tests: u32, local: u32) -> Place {
    if local == 0u {
        atomicStore(&made, 0u);
        atomicStore(&tests_of_all, 0u);
    }
    workgroupBarrier();
    var at = 0u;
    if own > 0u {
        at = atomicAdd(&made, own);
        atomicAdd(&tests_of_all, tests);
    }
    workgroupBarrier();
    if local == 0u {
        first_of_all = atomicAdd(&counts[TILE_COUNT], atomicLoad(&made));
        atomicAdd(&counts[TEST_COUNT], atomicLoad(&tests_of_all));
    }
    let first = workgroupUniformLoad(&first_of_all);
    return Place(first, first + at);
}
