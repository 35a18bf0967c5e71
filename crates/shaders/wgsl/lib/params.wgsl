// Parameters of a dispatch. Each kernel reads those it needs.

struct Params {
    // Camera: see geom::Camera. `width` is 0 for explicit rays.
    eye: vec3<f32>,
    width: u32,
    corner: vec3<f32>,
    height: u32,
    across: vec3<f32>,
    // `cluster`: number of tiles of the phases before this one. Treelet kernels that reach the root: total number of treelets.
    // `resolve_exact_together`: number of workgroups that share each of its two lists.
    first_group: u32,
    down: vec3<f32>,
    // Weight of the later key frame.
    alpha: f32,
    // In scaled units; in scene units for extreme rays.
    light: vec3<f32>,
    // k: vertices and origins are scaled by 2^-k.
    scale_exponent: i32,
    // Number of elements of this dispatch, or of the boxes where a workgroup's search starts; and the first element.
    count: u32,
    first: u32,
    // Offset of the leaves' triangles in the topology, in words.
    leaf_triangles_at: u32,
    node_count: u32,
    // Always 0, which the compiler must not know.
    zero: u32,
    // 1 if a list that begins at word `first` names the elements of this dispatch.
    listed: u32,
    // Offset of the results of this dispatch.
    destination: u32,
    // Number of key bits below the current digit. `cluster`: number of clusters by which tiles begin early.
    shift: u32,
    // Number of clusters that each tile leaves; or the row of the first box where a workgroup's search starts.
    goal: u32,
    // Maximum number of rounds that search for nearest neighbours. For answers: number of words of each.
    rounds: u32,
    // Number of invocations that resolve rays one by one: see fallback.wgsl.
    places: u32,
    // Capacity for candidate notes (see candidates.wgsl) or for tiles (see cover.wgsl).
    notes: u32,
    // Rule for extreme rays: 0 for that of `exact`, 1 for that of `watertight`.
    rule: u32,
    // `extreme`: 1 if all rays are extreme, 2 if only the buffer `range` holds the answer.
    // `tiny`: 1 if rays that start near the origin are extreme (geometry/units.wgsl).
    extreme: u32,
    tiny: u32,
    // 1 if coordinates differ in size by a factor so large that boxes of inner nodes are padded by their own distance.
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
    // Number of lanes of all wide nodes.
    wide_lanes: u32,
    depth: vec3<f32>,
    // The root's lanes; 0 if there is no wide tree.
    wide_root: u32,
    // Bound on the distance of a pixel's ray from the pixel's middle, in pixels, with a margin.
    pixel_margin: f32,
    // Largest scene extent that the offset of shadow rays takes into account, in scaled units: geom::Range.
    clearance: f32,
}

@group(0) @binding(0) var<uniform> params: Params;

// Returns the element of this invocation, for dispatches of one or two dimensions.
fn element(id: vec3<u32>, groups: vec3<u32>, group_size: u32) -> u32 {
    return id.x + id.y * groups.x * group_size;
}
