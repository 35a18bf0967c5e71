// What a search for the closest hit keeps of the leaves it sees. Most hits are told apart by how near and how far their
// triangles' corners are; only where that does not tell which comes first, distances are computed.

// The t of the best so far lies in low ..= high.
struct Found { low: f32, high: f32, leaf: u32 }

const NO_LEAF: u32 = 0xffffffffu;

fn nothing_found(ray: Prepared) -> Found { return Found(ray.t_max, ray.t_max, NO_LEAF); }

// Nodes entered beyond this need no visit.
fn limit(found: Found) -> f32 { return found.high; }

// Keeps the leaf's triangle if it is the least by t, then by index.
fn see_closest(ray: Prepared, leaf: u32, found: Found) -> Found {
    let g = glance(ray, corners_of(leaf));
    if g.passes || g.low > found.high || g.high <= ray.t_min { return found; }
    // 2^-100: a t below that is zero. Corners far apart would let the search go on for long behind the hit.
    let begins = g.low > max(ray.t_min, 7.888609052210118e-31);
    let is_thin = g.high - g.low < 0.03125 * g.high;
    if g.sure && begins && is_thin && g.high < found.low { return Found(g.low, g.high, leaf); }
    return weigh(ray, leaf, found);
}

// Likewise, by distances: of this triangle, and then of the best so far, where that may be as near.
fn weigh(ray: Prepared, leaf: u32, found: Found) -> Found {
    var mine = 0.0;
    // A loop, so that there is but one copy of all that; how often it turns the compiler must not know.
    for (var turn = params.zero; turn < 2u; turn += 1u) {
        let t = distance_to(ray, corners_of(select(leaf, found.leaf, turn == 1u)));
        if turn == 1u { return earlier(mine, leaf, t, found.leaf); }
        if !(t > ray.t_min && t < ray.t_max) || t > found.high { return found; }
        if found.leaf == NO_LEAF || t < found.low { return Found(t, t, leaf); }
        mine = t;
    }
    return found;
}

// Of two hits the one that is less by t, then by index.
fn earlier(t: f32, leaf: u32, other_t: f32, other: u32) -> Found {
    if t < other_t || (t == other_t && records[3u * leaf].w < records[3u * other].w) { return Found(t, t, leaf); }
    return Found(other_t, other_t, other);
}

// Writes a ray's hit, t in the ray's own units.
fn keep_closest(i: u32, ray: Prepared, found: Found) -> vec4<u32> {
    var hit = MISS;
    if !count_if_cut_short(i) && found.leaf != NO_LEAF {
        let corners = corners_of(found.leaf);
        let c = crossing(ray, corners);
        let by = divisor(c.det);
        let t = within_own(ray, corners, divide_by(c.t, by));
        let weights = vec2<f32>(divide_by(c.v, by), divide_by(c.w, by));
        hit = vec4<u32>(in_ray_units(t, ray.exponent), bitcast<vec2<u32>>(weights), corners.triangle);
        atomicAdd(&counts[2], 1u);
    }
    hits[i] = hit;
    return hit;
}

// Every hit stands.
fn is_left_open(hit: vec4<u32>) -> bool { return false; }
