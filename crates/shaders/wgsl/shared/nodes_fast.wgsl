// Layout `fast`: inner nodes of four rows, which hold both children's boxes; a leaf is one triangle or two.

const LEAF: u32 = 0x80000000u;
const TWO: u32 = 0x40000000u;
// No node at all; as a leaf it would be beyond all others.
const NONE: u32 = 0xffffffffu;

// The row of an inner node's left child; the right one's is two on.
fn children_of(at: u32) -> u32 { return 4u * at; }

// A leaf's first triangle, in leaf order, and the leaf of the others.
fn first_of(at: u32) -> u32 { return at & 0x3fffffffu; }
fn others_of(at: u32) -> u32 { return select(NONE, LEAF | (first_of(at) + 1u), (at & TWO) != 0u); }
