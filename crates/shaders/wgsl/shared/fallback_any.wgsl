// Settles rays whose notes do not tell whether they meet anything.

// The triangle that a shadow's ray leaves.
var<private> left_out: u32;
var<private> is_met: bool;

// Where the list of open rays begins.
fn list_at() -> u32 { return params.destination; }

fn is_open(i: u32) -> bool { return occluded[i] >= FIRST_NOTE; }

fn is_candidate(ray: Prepared, leaf: u32, bound: f32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == left_out { return false; }
    return judge(ray, corners).possible;
}

// Whether the leaf's triangle is met, which is enough.
fn see(leaf: u32) -> bool {
    let points = points_of(records[3u * leaf].w);
    let made = decide_alone(leaf, points).made;
    is_met = made.met == 1u;
    if made.hard == 1u { is_met = meet_exactly(points, 0u).met; }
    return is_met;
}

// Writes whether the ray at a place, whose line is set, meets anything but triangle `ignore`, and counts it as word `count`
// of `counts` if it does.
fn fallback_any(place: u32, i: u32, ray: Prepared, ignore: u32, count: u32) {
    left_out = ignore;
    make_line();
    set_view(ray);
    is_met = false;
    walk(place, ray, ray.t_max);
    answer_any(i, is_met, count);
}
