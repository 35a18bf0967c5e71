// Settles whether a ray meets anything: by its notes, or by another search and whole numbers of any length.

// The triangle that a shadow's ray leaves.
var<private> left_out: u32;

fn see_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore || !judge(ray, corners).possible { return false; }
    return meets(leaf, corners.triangle);
}

fn meets(leaf: u32, triangle: u32) -> bool {
    let points = points_of(triangle);
    let made = decide_alone(leaf, points).made;
    if made.hard == 0u { return made.met == 1u; }
    return meet_exactly(points, 0u).met;
}

fn see_far(leaf: u32) -> bool {
    let triangle = records[3u * leaf].w;
    return triangle != left_out && meets(leaf, triangle);
}

fn search_again(ray: Prepared, ignore: u32) -> bool {
    make_line();
    left_out = ignore;
    if ray.far { return walk_far(); }
    set_view(ray);
    return find_any(ray, ignore);
}

// What the notes of a ray say, for the ray's first invocation. All of a workgroup call it.
struct Said { met: bool, hard: bool }

fn said_by_notes(list: u32, local: u32) -> Said {
    var said = Said();
    var rest = Rest(list, false);
    while !rest.all_done {
        decide_notes(rest.list, local);
        if local % 16u == 0u {
            for (var k = local / 4u; k < local / 4u + 4u; k += 1u) {
                said.met = said.met || decided[k].met == 1u;
                said.hard = said.hard || decided[k].hard == 1u;
            }
        }
        rest = rest_of(rest.list, local);
    }
    return said;
}

// Writes whether one ray, whose line is set, meets anything, and counts it as word `count` of `counts` if it does.
fn settle_any(i: u32, ray: Prepared, ignore: u32, count: u32, said: Said) {
    var met = said.met;
    if !met && (said.hard || ray.far || blocked[i] == TOO_MANY) { met = search_again(ray, ignore); }
    blocked[i] = select(0u, 1u, met);
    if met { atomicAdd(&counts[count], 1u); }
}
