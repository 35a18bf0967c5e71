// What a search keeps of the leaves it sees when whole numbers settle who is first.

const NO_LEAF: u32 = 0xffffffffu;

struct Found { bound: f32, leaf: u32 }

// Of the candidates so far.
var<private> first: Crossing;
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
    let is_first = first_leaf == NO_LEAF;
    let c = meet_exactly(points_of(triangle), select(0u, 1u, !is_first && first.numerator == CROSSINGS));
    if !c.met { return; }
    if !is_first {
        let order = order_crossings(c, first);
        if order > 0 || (order == 0 && triangle > first_triangle) { return; }
    }
    first = c;
    first_leaf = leaf;
    first_triangle = triangle;
}

// Settles the hit of one ray, whose line is made.
fn settle_closest(i: u32, ray: Prepared) {
    last_bound = bitcast<f32>(hits[i].x);
    first_leaf = NO_LEAF;
    if ray.far {
        _ = walk_far();
    } else {
        _ = find_closest(ray);
    }
    if first_leaf == NO_LEAF {
        hits[i] = MISS;
        return;
    }
    if ray.far {
        hits[i] = vec4<u32>(rounded_t(first), 0u, 0u, first_triangle);
    } else {
        hits[i] = reported(ray, corners_of(first_leaf));
    }
    atomicAdd(&counts[2], 1u);
}
