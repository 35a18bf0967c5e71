// Extreme rays: what they hit, in whole numbers of any length. See "Extreme rays" in ARCHITECTURE.md. Who uses it declares
// `nodes`, `records`, `triangles`, `positions` and `counts`.

const NO_TRIANGLE: u32 = 0xffffffffu;

// The first so far: as it stands, and its t rounded once.
var<private> best: Crossing;
var<private> best_t: u32;
var<private> best_triangle: u32;

// The slot that the first so far does not take.
fn spare_slot() -> u32 { return select(0u, 1u, best_triangle != NO_TRIANGLE && best.numerator == CROSSINGS); }

// Whether the rule is that of `watertight`: an infinitely small move of the ray, and t as rounded.
fn rule_moves() -> bool { return params.rule == 1u; }

// Offers a triangle; whether it is met within the limits.
fn offer_extreme(triangle: u32) -> bool {
    let points = points_of(triangle);
    if surely_passes_by(points) { return false; }
    let c = cross_exactly(points, spare_slot(), rule_moves());
    if !c.met || (!rule_moves() && !is_within(c)) { return false; }
    let t = rounded(c);
    if rule_moves() && (ordered(t) <= ordered(line.t_min) || ordered(t) >= ordered(line.t_max)) { return false; }
    if best_triangle != NO_TRIANGLE {
        var order = select(0, 1, ordered(t) > ordered(best_t)) - select(0, 1, ordered(t) < ordered(best_t));
        if !rule_moves() { order = order_crossings(c, best); }
        if order > 0 || (order == 0 && triangle > best_triangle) { return true; }
    }
    best = c;
    best_t = t;
    best_triangle = triangle;
    return true;
}

// Goes down the tree for the line that is set, past triangle `ignore`; ends at the first that is met if `any` is.
fn search_extreme(ignore: u32, any: bool) {
    best_triangle = NO_TRIANGLE;
    atomicAdd(&counts[7], 1u);
    make_line();
    make_coarse();
    if !may_pass(nodes[0].xyz, nodes[1].xyz, line.t_max) { return; }
    var stack: array<u32, 64>;
    var depth = 0u;
    var at = nodes[0].w;
    loop {
        if at == NONE {
            if depth == 0u { break; }
            depth -= 1u;
            at = stack[depth];
        }
        if (at & LEAF) != 0u {
            let triangle = records[3u * first_of(at)].w;
            at = others_of(at);
            if triangle == ignore || triangle == NO_TRIANGLE { continue; }
            if offer_extreme(triangle) && any { break; }
        } else {
            let row = children_of(at);
            var bound = line.t_max;
            if best_triangle != NO_TRIANGLE { bound = from_ordered(min(ordered(bound), ordered(best_t) + 1)); }
            let left = may_pass(nodes[row].xyz, nodes[row + 1u].xyz, bound);
            let right = may_pass(nodes[row + 2u].xyz, nodes[row + 3u].xyz, bound);
            if left && right {
                stack[depth] = nodes[row + 2u].w;
                depth += 1u;
            }
            at = select(select(NONE, nodes[row + 2u].w, right), nodes[row].w, left);
        }
    }
}

// The closest hit along the line that is set.
fn closest_extreme() -> vec4<u32> {
    search_extreme(NO_TRIANGLE, false);
    if best_triangle == NO_TRIANGLE { return MISS; }
    atomicAdd(&counts[2], 1u);
    let weights = weights_of(points_of(best_triangle));
    return vec4<u32>(nearest_within(best_t, vec2<u32>(line.t_min, line.t_max)), weights, best_triangle);
}

// Whether the line that is set meets any triangle but one.
fn any_extreme(ignore: u32) -> bool {
    search_extreme(ignore, true);
    return best_triangle != NO_TRIANGLE;
}

// The weights of the second and the third corner, each rounded once. The line passes through the triangle.
fn weights_of(points: array<vec3<u32>, 3>) -> vec2<u32> {
    let placed = put_corners(points);
    let len = placed.len;
    let sum = CROSSINGS;
    let sides = vec2<u32>(CROSSINGS + 28u, CROSSINGS + 56u);
    clear(sum, len.triple);
    for (var side = 0u; side < 3u; side += 1u) {
        let to = select(PRODUCTS, select(sides.x, sides.y, side == 2u), side > 0u);
        put_side(to, side, len);
        accumulate(sum, len.triple, to, len.triple, ONE, 1u, 0u);
    }
    finish(sum, len.triple);
    var weights: vec2<u32>;
    for (var i = 0u; i < 2u; i += 1u) {
        words[sides[i]] = 0u;
        weights[i] = rounded(Crossing(true, sides[i], sum, len.triple, 0));
    }
    return weights;
}
