// Whether whole numbers let a ray meet a leaf's triangle.

// The triangle that a shadow's ray leaves.
var<private> left_out: u32;

fn see_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore || !judge(ray, corners).possible { return false; }
    return meet_exactly(points_of(corners.triangle), 0u).met;
}

fn see_far(leaf: u32) -> bool {
    let triangle = records[3u * leaf].w;
    return triangle != left_out && meet_exactly(points_of(triangle), 0u).met;
}

// The ray's line is made.
fn ask_any(ray: Prepared, ignore: u32) -> bool {
    left_out = ignore;
    if ray.far { return walk_far(); }
    return find_any(ray, ignore);
}

// Writes what was settled, and counts it as word `count` of `counts`.
fn keep_any(i: u32, met: bool, count: u32) {
    if !met { return; }
    blocked[i] = 1u;
    atomicAdd(&counts[count], 1u);
}
