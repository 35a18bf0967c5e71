// Adds a note to a ray's list.
fn with_note(list: u32, leaf: u32) -> u32 {
    if list == TOO_MANY { return TOO_MANY; }
    let note = new_note(leaf);
    if note != TOO_MANY { blocked[note_at(note) + 1u] = list; }
    return note;
}

// Whether a driver may have ended the search of a ray before it was done.
fn was_cut_short(i: u32) -> bool { return !loops_turn(i); }
