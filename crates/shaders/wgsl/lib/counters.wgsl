// Words of the buffer `counts`: see Counts in src/params.rs. A test compares them.

const INACTIVE_COUNT: u32 = 0u;
const DEGENERATE_COUNT: u32 = 1u;
const HIT_COUNT: u32 = 2u;
const OCCLUDED_COUNT: u32 = 3u;
const ROOT_AREA: u32 = 5u;
const UNDECIDED_RAYS: u32 = 7u;
const UNDECIDED_SHADOWS: u32 = 8u;
// HIT_COUNT or OCCLUDED_COUNT plus this is the word for undecided queries of that kind.
const UNDECIDED_OFFSET: u32 = 5u;
const CANDIDATE_COUNT: u32 = 9u;
// The word for undecided queries plus this is the word for those that candidates do not decide: see fallback.wgsl.
const FALLBACK_OFFSET: u32 = 3u;
const TILE_COUNT: u32 = 12u;
const LARGE_TRIANGLE_COUNT: u32 = 13u;
const TEST_COUNT: u32 = 14u;
// 1 if rasterization was incomplete.
const RASTER_INCOMPLETE: u32 = 15u;
// 1 if a search met an extreme ray, which `extreme_*` traces.
const FOUND_EXTREME: u32 = 16u;
// 2 if coordinates have very different sizes, else 1. If it is 2, the host sets `params.spread` in later submissions.
const SIZE_SPREAD: u32 = 17u;
