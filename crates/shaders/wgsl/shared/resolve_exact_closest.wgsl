// Settles which of a ray's candidates is first, by its notes.

// In place of a leaf: notes do not tell.
const UNTOLD: u32 = 0xfffffffeu;

// Looks over four notes that are decided, the first of which stands in place `at`; whether they all tell.
fn resolve(at: u32) -> bool {
    for (var k = at; k < at + 4u; k += 1u) {
        let made = decided[k];
        if made.hard == 1u { return false; }
        if made.met == 1u {
            let c = put_crossing(made.exponent, determinants[4u * k + 3u], determinants[4u * k]);
            offer(made, records[3u * made.leaf].w, c, true);
        }
    }
    return true;
}

// The leaf of the first of a ray's notes, for the ray's first invocation, or UNTOLD. All of a workgroup call it.
fn first_of_notes(list: u32, local: u32) -> u32 {
    first_leaf = NO_LEAF;
    var tells = true;
    var rest = Rest(list, false);
    while !rest.all_done {
        decide_notes(rest.list, local);
        if local % 16u == 0u { tells = resolve(local / 4u) && tells; }
        rest = rest_of(rest.list, local);
    }
    return select(UNTOLD, first_leaf, tells);
}

// Writes the hit of one ray, whose line is set, if its notes tell it.
fn resolve_exact_closest(i: u32, ray: Prepared, told: u32) {
    if told == UNTOLD || hits[i].y == TOO_MANY {
        atomicAdd(&counts[OPEN_RAYS + HARD], 1u);
        return;
    }
    if told == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    hits[i] = reported(ray, told, limits_of(i));
    atomicAdd(&counts[2], 1u);
}
