// Triangles that a search leaves to `settle_*`, as lists: one a ray, of two words a note, which are a leaf and the
// next note. They lie in `blocked` behind a word a ray and the list of open rays; there are as many as rays.

const NO_LEAF: u32 = 0xffffffffu;
const NO_NOTE: u32 = 0xffffffffu;
// There was no room for them all.
const TOO_MANY: u32 = 0xfffffffeu;

fn note_at(note: u32) -> u32 { return 2u * (params.first + note); }
