// Notes of triangles that a search leaves to `settle_*`, as lists: one a ray, of two words a note, which are a leaf and
// the next note. They lie in `blocked` behind a word a ray and the list of open rays; there may be as many as rays.

const NO_LEAF: u32 = 0xffffffffu;
const NO_NOTE: u32 = 0xffffffffu;
// In place of the first note: there was no room for them all.
const TOO_MANY: u32 = 0xfffffffeu;

fn note_at(note: u32) -> u32 { return 2u * (params.first + note); }

// A list to go through: empty where there was no room.
fn listed(list: u32) -> u32 { return select(list, NO_NOTE, list == TOO_MANY); }
