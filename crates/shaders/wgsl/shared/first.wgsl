// The first of a ray's candidates so far, as they come one by one.

// Of the candidates so far: where it is met, and about how far away, if that is known.
var<private> first: Crossing;
var<private> first_about: About;
var<private> first_told: bool;
var<private> first_leaf: u32;
var<private> first_triangle: u32;

// The slot that the first so far does not take.
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
