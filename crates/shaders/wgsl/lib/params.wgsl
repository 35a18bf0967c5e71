// Parameters of a dispatch: those that all kernels share, and one struct of the kernel's own.

// Kernels that trace rays, and those that resolve the rays that `exact` left undecided.
struct SearchParams {
    // Where the lists of undecided closest-hit rays and of undecided any-hit rays (explicit or shadow) begin in
    // `occluded`. Each has space for all rays.
    undecided_rays_at: u32,
    undecided_shadows_at: u32,
    // Number of invocations that each resolve one ray after another: see fallback.wgsl.
    fallback_workers: u32,
    // Maximum number of candidates: see candidates.wgsl.
    candidate_capacity: u32,
}

// Kernels that rasterize.
struct RasterParams {
    // Maximum number of tiles: see cover.wgsl.
    tile_capacity: u32,
}

// Kernels that trace extreme rays, which need exact arithmetic: see geom::CoordinateRange::is_extreme.
struct ExtremesParams {
    // The intersector whose hits are computed: 0 for `exact`, 1 for `watertight`.
    rule: u32,
    // Number of words of each result.
    answer_words: u32,
}

// `measure_range`.
struct MeasureParams {
    // Number of vertices from one sample to the next.
    sample_step: u32,
}

// `gather_corners`, and kernels that compute records and boxes of treelets.
struct TreeletsParams {
    // Index of the first treelet. If `uses_list` is 1: the word of `topology` where the list of treelets begins.
    first: u32,
    uses_list: u32,
    // Total number of treelets in `gather_corners` and in dispatches that sum the areas of all treelets, else 0.
    treelet_count: u32,
    // Word of `counts` for the sum of areas.
    sum_counter: u32,
}

// `sum_costs`.
struct SumParams {
    // Word of `counts` for the sum.
    counter: u32,
}

// `interpolate`.
struct InterpolationParams {
    // 1 if `moving_rows` lists the rows to write.
    uses_list: u32,
}

// `copy_points`.
struct PointsParams {
    // Offsets in words.
    source_at: u32,
    target_at: u32,
}

// Kernels that sort.
struct SortParams {
    // Where the elements begin before and after the pass.
    source_at: u32,
    target_at: u32,
    // Number of key bits below the current digit.
    shift: u32,
}

// `cluster`.
struct PhaseParams {
    // Number of tiles of the phases before this one.
    first_tile: u32,
    // Where the clusters begin before and after the phase.
    source_at: u32,
    target_at: u32,
    // Tile k begins at cluster k * CLUSTER_TILE - tile_offset, or at 0.
    tile_offset: u32,
    // Maximum number of clusters that a tile leaves.
    clusters_per_tile: u32,
    // Maximum number of rounds that search for nearest neighbours.
    search_rounds: u32,
}

// `count_answers`.
struct AnswerParams {
    // Number of words of a result, the word to test, and its value for a miss.
    words: u32,
    word: u32,
    miss: u32,
    // Word of `counts` for the number of results that are not a miss.
    counter: u32,
}

struct Params {
    // Camera: see geom::Camera. `width` is 0 for explicit rays. For `collapse_non_finite`, `eye` is the replacement point.
    eye: vec3<f32>,
    width: u32,
    corner: vec3<f32>,
    height: u32,
    across: vec3<f32>,
    // Offset of the leaves' triangles in the topology, in words.
    leaf_triangles_at: u32,
    down: vec3<f32>,
    // Weight of the later key frame.
    alpha: f32,
    // In scaled units; in scene units for `extreme_shadow_rays` and `shade`.
    light: vec3<f32>,
    // k: vertices and origins are scaled by 2^-k.
    scale_exponent: i32,
    // Number of elements of this dispatch.
    count: u32,
    // 2 n - 1 for n triangles: counts each triangle as a node, even where two share a leaf node. 0 without triangles.
    node_count: u32,
    // Always 0. Unknown to the compiler, so it prevents optimizations across it.
    zero: u32,
    // For `resolve_exact_camera`: a search starts with the boxes of the treelet roots of one level. Row of the first
    // root, and number of roots.
    start_row: u32,
    start_count: u32,
    // `extreme`: 1 if all rays are extreme (see ExtremesParams), 2 if kernels read from the buffer `range` which rays are.
    // `tiny`: 1 if rays that start near the origin are extreme (geometry/units.wgsl).
    extreme: u32,
    tiny: u32,
    // 1 if coordinates have very different sizes, else 0. If 1, each inner box is padded in proportion to its own
    // largest distance from the ray's origin. If 0, in proportion to the root box's.
    spread: u32,
    // The eye in scaled units.
    scaled_eye: vec3<f32>,
    // Exponent of the power of two by which depths are scaled: see docs/design/packets.md.
    depth_exponent: i32,
    // A point p relative to the eye appears in column dot(column, p) / dot(depth, p) and row dot(row, p) / dot(depth, p).
    column: vec3<f32>,
    // Offset of the wide tree in `topology`, in words.
    wide_at: u32,
    row: vec3<f32>,
    // Number of lanes of all wide nodes. Each child of a wide node is a lane.
    wide_lanes: u32,
    depth: vec3<f32>,
    // Reference to the root of the wide tree (visibility/outline.wgsl); 0 if there is no wide tree.
    wide_root: u32,
    // Bound on the distance of a pixel's ray from the pixel's middle, in pixels, with a margin.
    pixel_margin: f32,
    // Upper limit on the scene extent from which the offset of shadow rays is computed, in scaled units: see
    // geom::CoordinateRange.
    clearance: f32,
    // The kernel's own parameters, which a comment above its entry point names.
    @if(SEARCH) @align(16) search: SearchParams,
    @if(RASTER) @align(16) raster: RasterParams,
    @if(EXTREMES) @align(16) extremes: ExtremesParams,
    @if(MEASURE) @align(16) measure: MeasureParams,
    @if(TREELETS) @align(16) treelets: TreeletsParams,
    @if(SUM) @align(16) sum: SumParams,
    @if(INTERPOLATION) @align(16) interpolation: InterpolationParams,
    @if(POINTS) @align(16) points: PointsParams,
    @if(SORT) @align(16) sort: SortParams,
    @if(PHASE) @align(16) phase: PhaseParams,
    @if(ANSWER) @align(16) answer: AnswerParams,
}

@group(0) @binding(0) var<uniform> params: Params;

// Returns the index of this invocation's element, for dispatches of one or two dimensions.
fn element_index(id: vec3<u32>, groups: vec3<u32>, group_size: u32) -> u32 {
    return id.x + id.y * groups.x * group_size;
}
