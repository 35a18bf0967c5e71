// Another search for rays that notes do not tell of: a walk down the tree that can be left and gone on with at each node.

// The next node, those on the stack, and the leaf that is the answer so far.
struct Stand { at: u32, depth: u32, best: u32 }
struct Sought { stand: Stand, found: bool }

// The place of an invocation, of which one in sixteen has one: so it is alone in its vector on software drivers.
fn has_place(local: u32, place: u32, word: u32) -> bool {
    return local % 16u == 0u && place < params.places && atomicLoad(&counts[word + HARD]) > 0u;
}

// The ray at a place: that which it has begun, or the next open one.
fn ray_at(place: u32, word: u32) -> u32 {
    let base = place_at(place);
    var k = blocked[base];
    if k == DONE { return NO_RAY; }
    if blocked[base + 2u] != UNBEGUN { return blocked[list_at() + k]; }
    let open = atomicLoad(&counts[word]);
    var found = NO_RAY;
    while k < open {
        let i = blocked[list_at() + k];
        if is_open(i) {
            found = i;
            break;
        }
        k += params.places;
    }
    if !loops_turn(base + TURNS) { return NO_RAY; }
    if found != NO_RAY {
        blocked[base] = k;
        keep_stand(base, Stand(nodes[0].w, 0u, NO_LEAF));
        return found;
    }
    blocked[base] = DONE;
    atomicSub(&counts[word + LEFT], 1u);
    count_step();
    return NO_RAY;
}

fn keep_stand(base: u32, s: Stand) {
    blocked[base + 1u] = s.at;
    blocked[base + 2u] = s.depth;
    blocked[base + 3u] = s.best;
    count_step();
}

// The ray at a place is done.
fn leave(place: u32) {
    blocked[place_at(place)] += params.places;
    blocked[place_at(place) + 2u] = UNBEGUN;
    count_step();
}

// Something came of this dispatch.
fn count_step() {
    if loops_may_end() { atomicAdd(&counts[15], 1u); }
}

// Settles rays at a place, one after another, until none is open or loops end; the kernel says how, by `finish_ray`.
fn finish_open(local: u32, group: u32, word: u32) {
    let place = 4u * group + local / 16u;
    if !has_place(local, place, word) { return; }
    loop {
        let i = ray_at(place, word);
        if i == NO_RAY || !finish_ray(place, i) { break; }
        leave(place);
    }
}

fn may_meet(ray: Prepared, row: u32, bound: f32) -> bool {
    return meets_box(ray, nodes[row], nodes[row + 1u], bound);
}

// Goes on with the walk at a place, and keeps how far it came; whether all is seen. What it finds stands where `recall` puts
// it. Nothing is kept, nor any value of a loop used after it, before loops have been seen to be whole.
fn walk_on(place: u32, ray: Prepared, bound: f32) -> bool {
    let base = place_at(place);
    var s = Stand(blocked[base + 1u], blocked[base + 2u], blocked[base + 3u]);
    recall(s.best);
    loop {
        let sought = next_candidate(ray, bound, base, s);
        s = sought.stand;
        if !sought.found { break; }
        let enough = see(first_of(s.at));
        if !loops_turn(base + TURNS) { break; }
        s = Stand(select(others_of(s.at), NONE, enough), select(s.depth, 0u, enough), best_leaf());
        keep_stand(base, s);
    }
    return loops_turn(base + TURNS) && s.at == NONE && s.depth == 0u;
}

// Goes down to the next leaf that is a candidate, and keeps how far it came.
fn next_candidate(ray: Prepared, bound: f32, base: u32, begun: Stand) -> Sought {
    var s = begun;
    loop {
        if s.at == NONE {
            if s.depth == 0u { break; }
            s.depth -= 1u;
            s.at = blocked[base + STACK + s.depth];
        }
        if (s.at & LEAF) != 0u {
            if is_candidate(ray, first_of(s.at), bound) { return Sought(s, true); }
            s.at = others_of(s.at);
        } else {
            let row = children_of(s.at);
            let left = may_meet(ray, row, bound);
            let right = may_meet(ray, row + 2u, bound);
            if !loops_turn(base + TURNS) { break; }
            if left && right {
                blocked[base + STACK + s.depth] = nodes[row + 2u].w;
                s.depth += 1u;
            }
            s.at = select(select(NONE, nodes[row + 2u].w, right), nodes[row].w, left);
            keep_stand(base, s);
        }
    }
    return Sought(s, false);
}
