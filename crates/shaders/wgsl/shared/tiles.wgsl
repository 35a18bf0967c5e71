// What the buffer `covers` holds for rasterization, in rows of 16 bytes: first leaves of triangles that were too large for `cover_small`, one a
// row; then tiles: a leaf, the first of 8 x 4 pixels (column and row, 16 bits each), and which of those it may cover, a bit each,
// row by row.

// How many triangles may be too large.
const LISTED: u32 = 4096u;
const SIDES: vec2<i32> = vec2<i32>(8, 4);
// Where tiles, large triangles and tests are counted, and where it is said that rasterization do not tell all.
const TILE_COUNT: u32 = 12u;
const LARGE_COUNT: u32 = 13u;
const TEST_COUNT: u32 = 14u;
const UNTOLD: u32 = 15u;
