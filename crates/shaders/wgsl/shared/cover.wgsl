// What a triangle or a box covers of the picture, in 16 bytes: first and last column, first and last row (16 bits each), and
// how near it begins. Row 2 i + `wide_lanes` of `covers` is triangle i's, which ends with where the row of its third line begins;
// the row behind it holds the other lines: see project.wgsl. The first rows are those of the wide tree's lanes, which end with where they lead.

// First behind last: covers nothing.
const NOWHERE: u32 = 0x0000ffffu;
const EVERYWHERE: u32 = 0xffff0000u;

const BLOCK: u32 = 0x80000000u;
// The triangle of a record that no ray can hit.
const NO_TRIANGLE: u32 = 0xffffffffu;
// What a line that is none bounds, in 256ths of a pixel.
const BOUNDLESS: i32 = 0x20000000;
