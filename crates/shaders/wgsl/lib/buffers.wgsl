// The buffers that more than one file reads or writes. Hosts find them by name; the build numbers those that a kernel uses.
// An entry point's name is a condition: a buffer that a kernel only reads is declared so for it.

// The tree: two rows a node, the box's lower corner and what traversal calls the node, then its upper corner.
@if(cluster || refit || refit_treelets || preprocess || preprocess_treelets || preprocess_treelets_of_keys)
@group(0) @binding(next) var<storage, read_write> nodes: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read> nodes: array<vec4<u32>>;

// Three rows a triangle, in leaf order: see geometry/record.wgsl.
@if(preprocess || preprocess_treelets || preprocess_treelets_of_keys)
@group(0) @binding(next) var<storage, read_write> records: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read> records: array<vec4<u32>>;

// For each ray t and two weights as bits, and the triangle that it hits.
@if(shadow_rays || shadow_left || resolve_exact_shadow_rays || fallback_shadow_rays || extreme_shadow_rays || shade)
@group(0) @binding(next) var<storage, read> hits: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read_write> hits: array<vec4<u32>>;

// For each ray 1 if it meets anything; of intersector `exact` also notes: see intersect/candidates.wgsl.
@if(shade)
@group(0) @binding(next) var<storage, read> occluded: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> occluded: array<u32>;

// What is counted: see Counts in src/params.rs. The sums of areas among them are f32.
@if(refit_treelets || sum_costs)
@group(0) @binding(next) var<storage, read_write> counts: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> counts: array<atomic<u32>>;

// Rays given one by one, two rows each: origin and t_min, direction and t_max.
@group(0) @binding(next) var<storage, read> rays: array<vec4<u32>>;

// How far coordinates reach, where the host does not know: see geometry/range.wgsl.
@if(measure_range)
@group(0) @binding(next) var<storage, read_write> range: array<atomic<u32>>;
@else
@group(0) @binding(next) var<storage, read> range: array<u32>;

// Three vertices a triangle.
@group(0) @binding(next) var<storage, read> triangles: array<u32>;

// Three coordinates a vertex, in the scene's units.
@group(0) @binding(next) var<storage, read> positions: array<u32>;

// The tree's record as the host gives it.
@group(0) @binding(next) var<storage, read> topology: array<u32>;

// Sums of areas, one a workgroup; of treelets see build/treelet_refit.wgsl.
@if(sum_costs)
@group(0) @binding(next) var<storage, read> costs: array<vec4<f32>>;
@elif(gather_corners)
@group(0) @binding(next) var<storage, read_write> costs: array<u32>;
@elif(preprocess_treelets_of_keys)
@group(0) @binding(next) var<storage, read_write> costs: array<atomic<u32>>;
@else
@group(0) @binding(next) var<storage, read_write> costs: array<f32>;

// What triangles and boxes cover of the picture: see visibility/outline.wgsl and visibility/cover.wgsl.
@if(project || cover_small || cover_large)
@group(0) @binding(next) var<storage, read_write> covers: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read> covers: array<vec4<u32>>;
