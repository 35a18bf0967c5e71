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

// Writes the hit of the ray at a place, whose line is set.
fn fallback_closest(place: u32, i: u32, ray: Prepared) {
    make_line();
    set_view(ray);
    first_leaf = NO_LEAF;
    walk(place, ray, bitcast<f32>(hits[i].x));
    if first_leaf == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    hits[i] = reported(ray, first_leaf, limits_of(i));
    atomicAdd(&counts[2], 1u);
}
