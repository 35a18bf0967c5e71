// What a search for the closest hit keeps of the leaves it sees. Most hits are told apart by how near and how far their
// triangles' corners are; only where that does not tell which comes first, distances are computed.

// The t of the best so far lies in low ..= high.
struct Found { low: f32, high: f32, leaf: u32 }

const NO_LEAF: u32 = 0xffffffffu;

fn nothing_found(ray: Prepared) -> Found { return Found(ray.t_max, ray.t_max, NO_LEAF); }

// Nodes entered beyond this need no visit.
fn limit(found: Found) -> f32 { return found.high; }

// Keeps the leaf's triangle if it is the least by t, then by index.
fn intersect_leaf_closest(ray: Prepared, leaf: u32, found: Found) -> Found {
    let corners = turned_corners(ray, leaf);
    let e = edges_of(ray, corners);
    if surely_passes(e) { return found; }
    let span = span_of(ray, e);
    if span.x > found.high || span.y <= ray.t_min { return found; }
    // Corners far apart would let the search go on for long behind the hit. 8192 pads are 0.008 D.
    let is_thin = span.y - span.x < max(0.125 * span.y, 8192.0 * ray.pad);
    if signs_stand(e) && begins_within(ray, span.x) && is_thin && span.y < found.low { return Found(span.x, span.y, leaf); }
    let t = distance_to(ray, corners, e);
    if !(t > ray.t_min && t < ray.t_max) || t > found.high { return found; }
    if found.leaf == NO_LEAF || t < found.low { return Found(t, t, leaf); }
    let others = turned_corners(ray, found.leaf);
    return earlier(t, leaf, distance_to(ray, others, edges_of(ray, others)), found.leaf);
}

// Of two hits the one that is less by t, then by index.
fn earlier(t: f32, leaf: u32, other_t: f32, other: u32) -> Found {
    if t < other_t || (t == other_t && records[3u * leaf].w < records[3u * other].w) { return Found(t, t, leaf); }
    return Found(other_t, other_t, other);
}

// What is written for a ray, t in the ray's own units.
fn hit_of(i: u32, ray: Prepared, found: Found) -> vec4<u32> {
    if found.leaf == NO_LEAF { return MISS; }
    atomicAdd(&counts[2], 1u);
    let corners = turned_corners(ray, found.leaf);
    let c = crossing(edges_of(ray, corners));
    let by = divisor(c.det);
    let t = within_own(ray, corners, divide_by(c.t, by));
    let weights = vec2<f32>(divide_by(c.v, by), divide_by(c.w, by));
    return vec4<u32>(in_ray_units(t, ray.exponent), bitcast<vec2<u32>>(weights), corners.triangle);
}

// Every hit stands.
fn is_unresolved(hit: vec4<u32>) -> bool { return false; }
