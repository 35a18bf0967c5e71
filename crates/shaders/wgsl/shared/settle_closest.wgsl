// Settles which of a ray's candidates is first: by its notes, or by another search and whole numbers of any length.

struct Found { bound: f32, leaf: u32 }

// Of the candidates that another search has found so far, and how far away it is, if that is known.
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

// Keeps a leaf if its triangle is met before all others: least t, then least index.
fn consider(leaf: u32) {
    let triangle = records[3u * leaf].w;
    let points = points_of(triangle);
    let is_first = first_leaf == NO_LEAF;
    let slot = select(0u, 1u, !is_first && first.numerator == CROSSINGS);
    let alone = decide_alone(leaf, points);
    let told = alone.made.hard == 0u;
    if told && alone.made.met == 0u { return; }
    var c = crossing_in(slot, alone.made.exponent);
    if told {
        put_192(c.numerator, alone.n);
        put_192(c.denominator, alone.d);
    } else {
        c = meet_exactly(points, slot);
    }
    if !c.met { return; }
    if !is_first {
        var order = 0;
        if told && first_told { order = compare_about(alone.made.about, first_about); }
        if order == 0 { order = order_crossings(c, first); }
        if order > 0 || (order == 0 && triangle > first_triangle) { return; }
    }
    first = c;
    first_about = alone.made.about;
    first_told = told;
    first_leaf = leaf;
    first_triangle = triangle;
}

// In place of a leaf: notes do not tell.
const UNTOLD: u32 = 0xfffffffeu;

// The first of the triangles that are met: least t, then least index.
struct First { leaf: u32, triangle: u32, made: Decided }

const NO_FIRST: First = First(NO_LEAF, NO_LEAF, Decided());
// Looks over four notes that are decided, the first of which stands in place `at`.
fn resolve(so_far: First, at: u32) -> First {
    var first = so_far;
    for (var k = at; k < at + 4u; k += 1u) {
        let made = decided[k];
        if made.hard == 1u { first.leaf = UNTOLD; }
        if made.met == 0u || first.leaf == UNTOLD { continue; }
        let triangle = records[3u * made.leaf].w;
        var order = -1;
        if first.leaf != NO_LEAF {
            order = compare_about(made.about, first.made.about);
            if order == 0 { order = order_exactly(made, k, first.made); }
        }
        if order > 0 || (order == 0 && triangle >= first.triangle) { continue; }
        first = First(made.leaf, triangle, made);
        put_first(k);
    }
    return first;
}

// The first so far keeps its numbers in place 0 of two.
fn put_first(k: u32) {
    put_192(CROSSINGS, determinants[4u * k + 3u]);
    put_192(CROSSINGS + 28u, determinants[4u * k]);
}

fn order_exactly(made: Decided, k: u32, other: Decided) -> i32 {
    put_192(CROSSINGS + 56u, determinants[4u * k + 3u]);
    put_192(CROSSINGS + 84u, determinants[4u * k]);
    return order_crossings(crossing_in(1u, made.exponent), crossing_in(0u, other.exponent));
}

// The leaf of the first of a ray's notes, for the ray's first invocation, or UNTOLD. All of a workgroup call it.
fn first_of_notes(list: u32, local: u32) -> u32 {
    var first = NO_FIRST;
    var rest = Rest(list, false);
    while !rest.all_done {
        decide_notes(rest.list, local);
        if local % 16u == 0u { first = resolve(first, local / 4u); }
        rest = rest_of(rest.list, local);
    }
    return first.leaf;
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
