// Adds a note to a ray's list.
fn with_note(list: u32, leaf: u32) -> u32 {
    if list == TOO_MANY { return TOO_MANY; }
    let note = new_note(leaf);
    if note != TOO_MANY { occluded[note_at(note) + 1u] = list; }
    return note;
}
