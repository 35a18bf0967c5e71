// Settles which of a ray's candidates is first: by its notes, or by another search and whole numbers of any length.

struct Found { bound: f32, leaf: u32 }

// Of the candidates so far: where it is met, and about how far away, if that is known.
var<private> first: Crossing;
var<private> first_about: About;
var<private> first_told: bool;
var<private> first_leaf: u32;
var<private> first_triangle: u32;
// As the search before had it.
var<private> last_bound: f32;

fn nothing_found(ray: Prepared) -> Found { return Found(last_bound, NO_LEAF); }

fn limit(found: Found) -> f32 { return found.bound; }

fn see_closest(ray: Prepared, leaf: u32, found: Found) -> Found {
    let j = judge(ray, corners_of(leaf));
    if j.possible && j.low <= found.bound { consider(leaf); }
    return found;
}

fn see_far(leaf: u32) -> bool {
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

// The place that the first so far does not take.
fn free_slot() -> u32 { return select(0u, 1u, first_leaf != NO_LEAF && first.numerator == CROSSINGS); }

fn put_crossing(exponent: i32, n: Whole192, d: Whole192) -> Crossing {
    let c = crossing_in(free_slot(), exponent);
    put_192(c.numerator, n);
    put_192(c.denominator, d);
    return c;
}

// Keeps a triangle that is met at `c` if that is before all others: least t, then least index. `told` says whether
// it is known about where.
fn offer(made: Decided, triangle: u32, c: Crossing, told: bool) {
    if first_leaf != NO_LEAF {
        var order = 0;
        if told && first_told { order = compare_about(made.about, first_about); }
        if order == 0 { order = order_crossings(c, first); }
        if order > 0 || (order == 0 && triangle > first_triangle) { return; }
    }
    first = c;
    first_about = made.about;
    first_told = told;
    first_leaf = made.leaf;
    first_triangle = triangle;
}

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

// Writes the hit of one ray, whose line is set.
fn settle_closest(i: u32, ray: Prepared, told: u32) {
    var leaf = told;
    if leaf == UNTOLD || ray.far || hits[i].y == TOO_MANY {
        leaf = search_again(i, ray);
        if leaf != NO_LEAF && ray.far {
            hits[i] = vec4<u32>(rounded_t(first), 0u, 0u, first_triangle);
            atomicAdd(&counts[2], 1u);
            return;
        }
    }
    if leaf == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    hits[i] = reported(ray, corners_of(leaf));
    atomicAdd(&counts[2], 1u);
}

fn search_again(i: u32, ray: Prepared) -> u32 {
    make_line();
    last_bound = bitcast<f32>(hits[i].x);
    first_leaf = NO_LEAF;
    if ray.far {
        _ = walk_far();
    } else {
        set_view(ray);
        _ = find_closest(ray);
    }
    return first_leaf;
}
