// What changes from one dispatch to the next. Each kernel reads the part it needs.

struct Params {
    // Camera: see geom::Camera. Of rays given one by one, width is 0.
    eye: vec3<f32>,
    width: u32,
    corner: vec3<f32>,
    height: u32,
    across: vec3<f32>,
    // Workgroups of the levels that refit did before this one; for the last of treelets, and for those that climb, how many there are in all.
    // Of `resolve_exact_together`, those that share each of the two lists.
    first_group: u32,
    down: vec3<f32>,
    // Weight of the later key frame.
    alpha: f32,
    // In scaled units; of extreme rays, in the scene's.
    light: vec3<f32>,
    // 1 if the tree has layout `fast`, 0 if it has `bvh2`.
    fast_layout: u32,
    // k: vertices and origins are scaled by 2^-k.
    scale_exponent: i32,
    // Elements of this dispatch, or boxes that a search by many begins at; and the first of the elements.
    count: u32,
    first: u32,
    // Where the topology's parts begin, in words.
    leaf_bits_at: u32,
    leaf_ranks_at: u32,
    leaf_triangles_at: u32,
    node_count: u32,
    // Always 0, which the compiler must not know.
    zero: u32,
    // 1 if the elements of this dispatch are named by a list that begins at word `first`.
    listed: u32,
    // Where the elements of this dispatch go.
    destination: u32,
    // Bits of a key below its digit; clusters by which packets begin early.
    shift: u32,
    // Clusters that a packet leaves; or the row of the first of those boxes.
    goal: u32,
    // Rounds that seek nearest neighbours.
    rounds: u32,
    // Places at which rays are settled one by one: see fallback.wgsl.
    places: u32,
    // How many notes there is room for: see candidates.wgsl; or tiles: see cover.wgsl.
    notes: u32,
    // Of extreme rays: 0 as `exact`, 1 as `watertight` has it.
    rule: u32,
    // The eye in scaled units.
    scaled_eye: vec3<f32>,
    // What depth is scaled by, as a power of two: see docs/design/packets.md.
    depth_exponent: i32,
    // A point p from the eye is seen in column dot(column, p) / dot(depth, p), likewise in its row.
    column: vec3<f32>,
    // Where the wide tree begins in `topology`, in words.
    wide_at: u32,
    row: vec3<f32>,
    // Lanes of all its nodes.
    wide_lanes: u32,
    depth: vec3<f32>,
    // Its root's lanes; 0 if there is no wide tree.
    wide_root: u32,
    // How far a pixel's ray may lie from its middle, in pixels, and a bit.
    pixel_margin: f32,
    // The extent of the scene that shadows' rays always heed, in scaled units: geom::Range.
    clearance: f32,
    // 1 if all rays are extreme, and if those are that start near the origin: geometry/units.wgsl. Of extreme rays `extreme` is
    // 2 where only the buffer `range` tells.
    extreme: u32,
    tiny: u32,
    // 1 if sizes of coordinates differ so much that boxes of inner nodes are padded by their own distance.
    spread: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

// The element of this invocation, for dispatches of one or two dimensions.
fn element(id: vec3<u32>, groups: vec3<u32>, group_size: u32) -> u32 {
    return id.x + id.y * groups.x * group_size;
}
