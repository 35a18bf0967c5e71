// Adds a note to a ray's list, by word `count` of `counts`.
fn with_note(list: u32, leaf: u32, count: u32) -> u32 {
    if list == TOO_MANY { return TOO_MANY; }
    let place = atomicAdd(&counts[count], 1u);
    if place >= params.notes { return TOO_MANY; }
    let note = place + FIRST_NOTE;
    blocked[note_at(note)] = leaf;
    blocked[note_at(note) + 1u] = list;
    return note;
}

// Whether a driver may have ended the search of a ray before it was done.
fn was_cut_short(i: u32) -> bool { return params.bounded_loops != 0u && !loops_turn(i); }
