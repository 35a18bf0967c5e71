// Settles which of a ray's candidates is first: those it has notes of, or those that another search finds.

struct Found { bound: f32, leaf: u32 }

// Of the candidates so far: where its t lies, and the crossing, if one was made, in place `first_slot`.
var<private> first_leaf: u32;
var<private> first_triangle: u32;
var<private> first_span: vec2<f32>;
var<private> first_crossing: Crossing;
var<private> first_slot: u32;
// As the search before had it.
var<private> last_bound: f32;

fn nothing_found(ray: Prepared) -> Found { return Found(last_bound, NO_LEAF); }

fn limit(found: Found) -> f32 { return found.bound; }

fn see_closest(ray: Prepared, leaf: u32, found: Found) -> Found {
    consider(ray, leaf);
    return found;
}

fn see_far(leaf: u32) -> bool {
    let triangle = records[3u * leaf].w;
    let c = cross_exactly(points_of(triangle), 1u - first_slot);
    if c.met { offer(leaf, triangle, vec2<f32>(-DEEP, DEEP), c); }
    return false;
}

fn consider(ray: Prepared, leaf: u32) {
    let corners = corners_of(leaf);
    let j = judge(ray, corners);
    if !j.possible || !(j.low <= last_bound) { return; }
    var c = NOT_MET;
    if !j.sure {
        let decided = decide(ray, corners, j, 1u - first_slot);
        if !decided.met { return; }
        c = decided.crossing;
    }
    offer(leaf, corners.triangle, vec2<f32>(j.low, j.high), c);
}

// Takes a triangle that is hit if it is met before the first so far: least t, then least index. `c` may be unmade.
fn offer(leaf: u32, triangle: u32, span: vec2<f32>, made: Crossing) {
    var c = made;
    if first_leaf != NO_LEAF && !(span.y < first_span.x) {
        if span.x > first_span.y { return; }
        if !first_crossing.met { first_crossing = cross_exactly(points_of(first_triangle), first_slot); }
        if !c.met { c = cross_exactly(points_of(triangle), 1u - first_slot); }
        let order = order_crossings(c, first_crossing);
        if order > 0 || (order == 0 && triangle >= first_triangle) { return; }
    }
    if c.met { first_slot = 1u - first_slot; }
    first_leaf = leaf;
    first_triangle = triangle;
    first_span = span;
    first_crossing = c;
}

// Begins with what the search before was sure of.
fn begin(known: vec4<u32>) {
    last_bound = bitcast<f32>(known.x);
    first_leaf = known.z;
    first_span = vec2<f32>(bitcast<f32>(known.y), last_bound);
    first_crossing = NOT_MET;
    first_slot = 0u;
    if first_leaf != NO_LEAF { first_triangle = records[3u * first_leaf].w; }
}

// Settles the hit of one ray, whose line is set.
fn settle_closest(i: u32, ray: Prepared) {
    begin(hits[i]);
    set_view(ray);
    var note = hits[i].w;
    if ray.far {
        _ = walk_far();
    } else if note == TOO_MANY {
        _ = find_closest(ray);
    } else {
        while note != NO_NOTE {
            consider(ray, blocked[note_at(note)]);
            note = blocked[note_at(note) + 1u];
        }
    }
    if first_leaf == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    if ray.far {
        hits[i] = vec4<u32>(rounded_t(first_crossing), 0u, 0u, first_triangle);
    } else {
        hits[i] = reported(ray, corners_of(first_leaf));
    }
    atomicAdd(&counts[2], 1u);
}
