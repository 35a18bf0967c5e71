// Buffers that several kernels use. The host binds them by name; the build numbers those that a kernel uses.
// An entry point's name is a condition: a buffer is declared read-only for kernels that only read it.

// The tree, two rows per node: lower corner of the node's box and the reference to its children or triangles
// (geometry/node.wgsl), then the upper corner.
@if(cluster || refit_treelets || preprocess_treelets || preprocess_treelets_from_key_frames)
@group(0) @binding(next) var<storage, read_write> nodes: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read> nodes: array<vec4<u32>>;

// Triangle records, three rows each, in leaf order: see geometry/record.wgsl.
@if(cluster_leaves || preprocess_treelets || preprocess_treelets_from_key_frames)
@group(0) @binding(next) var<storage, read_write> records: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read> records: array<vec4<u32>>;

// Per ray: t and two weights as bits, and the index of the triangle hit.
@if(shadow_rays || resolve_exact_shadow_rays || fallback_shadow_rays || extreme_shadow_rays || shade)
@group(0) @binding(next) var<storage, read> hits: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read_write> hits: array<vec4<u32>>;

// Per ray: 1 if it hits anything (any-hit queries), or if its hit is in shadow. `exact` also stores candidates here:
// see intersect/candidates.wgsl.
@if(shade)
@group(0) @binding(next) var<storage, read> occluded: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> occluded: array<u32>;

// Counters: see Counts in src/params.rs. The sums of areas among them are f32.
@if(refit_treelets || sum_costs)
@group(0) @binding(next) var<storage, read_write> counts: array<u32>;
@else
@group(0) @binding(next) var<storage, read_write> counts: array<atomic<u32>>;

// Explicit rays, two rows each: origin and t_min, direction and t_max.
@group(0) @binding(next) var<storage, read> rays: array<vec4<u32>>;

// Range of the coordinates, measured on the device where the host does not know it: see geometry/range.wgsl.
@if(measure_range)
@group(0) @binding(next) var<storage, read_write> range: array<atomic<u32>>;
@else
@group(0) @binding(next) var<storage, read> range: array<u32>;

// Three vertex indices per triangle.
@group(0) @binding(next) var<storage, read> triangles: array<u32>;

// Three coordinates per vertex, in scene units.
@group(0) @binding(next) var<storage, read> positions: array<u32>;

// The tree's topology, as the host uploads it.
@group(0) @binding(next) var<storage, read> topology: array<u32>;

// Sums of areas: one per treelet, or per tile of `cluster`. For treelets, build/treelet_refit.wgsl has the whole
// layout.
@if(sum_costs)
@group(0) @binding(next) var<storage, read> costs: array<vec4<f32>>;
@elif(gather_corners)
@group(0) @binding(next) var<storage, read_write> costs: array<u32>;
@elif(preprocess_treelets_from_key_frames)
@group(0) @binding(next) var<storage, read_write> costs: array<atomic<u32>>;
@else
@group(0) @binding(next) var<storage, read_write> costs: array<f32>;

// Screen-space coverage of triangles and boxes: see visibility/outline.wgsl and visibility/cover.wgsl.
@if(project || cover_small || cover_large)
@group(0) @binding(next) var<storage, read_write> pixel_coverage: array<vec4<u32>>;
@else
@group(0) @binding(next) var<storage, read> pixel_coverage: array<vec4<u32>>;
