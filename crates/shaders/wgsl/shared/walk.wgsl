// Another search for rays that notes do not tell of: down the tree, candidate by candidate, by one invocation a ray. Its stack
// lies in `occluded` behind the notes.

const STACK: u32 = 64u;

fn stack_at(place: u32) -> u32 { return 2u * params.first + 3u * params.notes + STACK * place; }

// Settles every open ray whose turn is at this invocation's place; the kernel says how, by `fallback_ray`. One invocation in
// sixteen has a place: so it is alone in its vector on software drivers.
fn fallback_open(local: u32, group: u32, word: u32) {
    let place = 4u * group + local / 16u;
    if local % 16u != 0u || place >= params.places || atomicLoad(&counts[word + HARD]) == 0u { return; }
    let open = atomicLoad(&counts[word]);
    for (var k = place; k < open; k += params.places) {
        let i = occluded[list_at() + k];
        if is_open(i) { fallback_ray(place, i); }
    }
}

fn may_meet(ray: Prepared, row: u32, bound: f32) -> bool {
    return meets_box(ray, nodes[row], nodes[row + 1u], bound);
}

// Shows `see` every candidate, until one is enough.
fn walk(place: u32, ray: Prepared, bound: f32) {
    let stack = stack_at(place);
    var at = nodes[0].w;
    var depth = 0u;
    loop {
        if at == NONE {
            if depth == 0u { break; }
            depth -= 1u;
            at = occluded[stack + depth];
        }
        if (at & LEAF) != 0u {
            let leaf = first_of(at);
            if is_candidate(ray, leaf, bound) && see(leaf) { break; }
            at = others_of(at);
        } else {
            let row = children_of(at);
            let left = may_meet(ray, row, bound);
            let right = may_meet(ray, row + 2u, bound);
            if left && right {
                occluded[stack + depth] = nodes[row + 2u].w;
                depth += 1u;
            }
            at = select(select(NONE, nodes[row + 2u].w, right), nodes[row].w, left);
        }
    }
}
