// What the buffer `covers` holds, in rows of 16 bytes that begin alike: first and last column, first and last row (16 bits each),
// and how near the thing begins, as a float's bits. First come the lanes of the wide tree, a row each, which ends with where the lane leads;
// from row `wide_lanes` on triangles in leaf order, two rows each: the first ends with where the third of its lines begins, the
// second has the others and all slopes (see `Line` in project.wgsl).

// First behind last: covers nothing.
const NOWHERE: u32 = 0x0000ffffu;
const EVERYWHERE: u32 = 0xffff0000u;

const BLOCK: u32 = 0x80000000u;
// The triangle of a record that no ray can hit.
const NO_TRIANGLE: u32 = 0xffffffffu;
// What a line that is none bounds, in 256ths of a pixel.
const BOUNDLESS: i32 = 0x20000000;
