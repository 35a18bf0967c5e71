// Settles whether a ray meets anything, by its notes.

// What the notes of a ray say, for the ray's first invocation. All of a workgroup call it.
struct Said { met: bool, hard: bool }

fn said_by_notes(list: u32, local: u32) -> Said {
    var said = Said();
    var rest = Rest(list, false);
    while !rest.all_done {
        decide_notes(rest.list, local);
        if local % 16u == 0u {
            for (var k = local / 4u; k < local / 4u + 4u; k += 1u) {
                said.met = said.met || decided[k].met == 1u;
                said.hard = said.hard || decided[k].hard == 1u;
            }
        }
        rest = rest_of(rest.list, local);
    }
    return said;
}

// Writes whether one ray, whose line is set, meets anything, and counts it as word `count` of `counts` if it does; if its notes tell it.
fn resolve_exact_any(i: u32, count: u32, said: Said) {
    if !said.met && (said.hard || occluded[i] == TOO_MANY) {
        atomicAdd(&counts[count + 5u + HARD], 1u);
        return;
    }
    answer_any(i, said.met, count);
}
