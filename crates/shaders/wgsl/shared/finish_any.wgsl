// Settles rays whose notes do not tell whether they meet anything.

// The triangle that a shadow's ray leaves.
var<private> left_out: u32;
var<private> met_leaf: u32;

// Where the list of open rays begins.
fn list_at() -> u32 { return params.destination; }

fn is_open(i: u32) -> bool { return blocked[i] >= FIRST_NOTE; }

fn is_candidate(ray: Prepared, leaf: u32, bound: f32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == left_out { return false; }
    return judge(ray, corners).possible;
}

// Whether the leaf's triangle is met, which is enough.
fn see(leaf: u32) -> bool {
    let points = points_of(records[3u * leaf].w);
    let made = decide_alone(leaf, points).made;
    var met = made.met == 1u;
    if made.hard == 1u { met = meet_exactly(points, 0u).met; }
    if met { met_leaf = leaf; }
    return met;
}

fn best_leaf() -> u32 { return met_leaf; }

fn recall(leaf: u32) { met_leaf = leaf; }

// Writes whether the ray at a place, whose line is set, meets anything but triangle `ignore`, and counts it as word `count`
// of `counts` if it does; false if turns ran out before.
fn finish_any(place: u32, i: u32, ray: Prepared, ignore: u32, count: u32) -> bool {
    left_out = ignore;
    make_line();
    set_view(ray);
    if !walk_on(place, ray, ray.t_max) { return false; }
    answer_any(i, met_leaf != NO_LEAF, count);
    return true;
}
