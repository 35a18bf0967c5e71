// Settles whether a ray meets one of the triangles it has notes of, or one that another search finds.

// The triangle that a shadow's ray leaves.
var<private> left_out: u32;

fn see_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return false; }
    let j = judge(ray, corners);
    return j.possible && (j.sure || decide(ray, corners, j, 0u).met);
}

fn see_far(leaf: u32) -> bool {
    let triangle = records[3u * leaf].w;
    return triangle != left_out && cross_exactly(points_of(triangle), 0u).met;
}

// The ray's line is set.
fn meets_any(ray: Prepared, ignore: u32, notes: u32) -> bool {
    left_out = ignore;
    if ray.far { return walk_far(); }
    set_view(ray);
    if notes == TOO_MANY { return find_any(ray, ignore); }
    for (var note = notes; note != NO_NOTE; note = blocked[note_at(note) + 1u]) {
        if see_any(ray, blocked[note_at(note)], ignore) { return true; }
    }
    return false;
}

// Settles one ray, and counts it as word `count` of `counts` if it meets anything.
fn settle_any(i: u32, ray: Prepared, ignore: u32, count: u32) {
    let met = meets_any(ray, ignore, blocked[i]);
    blocked[i] = select(0u, 1u, met);
    if met { atomicAdd(&counts[count], 1u); }
}
