// Settles rays whose notes do not tell which of their candidates is first.

// Where the list of open rays begins.
fn list_at() -> u32 { return params.first; }

fn is_open(i: u32) -> bool { return hits[i].z == OPEN; }

fn is_candidate(ray: Prepared, leaf: u32, bound: f32) -> bool {
    let j = judge(ray, corners_of(leaf));
    return j.possible && j.low <= bound;
}

// Never is one candidate enough.
fn see(leaf: u32) -> bool {
    consider(leaf);
    return false;
}

fn best_leaf() -> u32 { return first_leaf; }

fn recall(leaf: u32) {
    first_leaf = NO_LEAF;
    if leaf != NO_LEAF { consider(leaf); }
}

// Settles a leaf's triangle by itself.
fn consider(leaf: u32) {
    let triangle = records[3u * leaf].w;
    let points = points_of(triangle);
    let alone = decide_alone(leaf, points);
    let told = alone.made.hard == 0u;
    if told {
        if alone.made.met == 1u { offer(alone.made, triangle, put_crossing(alone.made.exponent, alone.n, alone.d), true); }
        return;
    }
    let c = meet_exactly(points, free_slot());
    if c.met { offer(alone.made, triangle, c, false); }
}

// Writes the hit of the ray at a place, whose line is set; false if turns ran out before.
fn finish_closest(place: u32, i: u32, ray: Prepared) -> bool {
    make_line();
    set_view(ray);
    if !walk_on(place, ray, bitcast<f32>(hits[i].x)) { return false; }
    var hit = MISS;
    if first_leaf != NO_LEAF { hit = reported(ray, first_leaf, limits_of(i)); }
    if !loops_turn(place_at(place) + TURNS) { return false; }
    hits[i] = hit;
    if first_leaf != NO_LEAF { atomicAdd(&counts[2], 1u); }
    return true;
}
