// Adds a note to a ray's list, by word `count` of `counts`.
fn with_note(list: u32, leaf: u32, count: u32) -> u32 {
    if list == TOO_MANY { return TOO_MANY; }
    let note = atomicAdd(&counts[count], 1u);
    if note >= params.first { return TOO_MANY; }
    blocked[note_at(note)] = leaf;
    blocked[note_at(note) + 1u] = list;
    return note;
}
