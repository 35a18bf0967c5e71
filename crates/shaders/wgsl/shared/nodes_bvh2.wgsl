// Layout `bvh2`: two rows a node, siblings side by side; a leaf is one triangle.

const LEAF: u32 = 0x80000000u;
// No node at all; as a leaf it would be beyond all others.
const NONE: u32 = 0xffffffffu;

// The row of an inner node's left child; the right one's is two on.
fn children_of(at: u32) -> u32 { return 2u * at; }

// A leaf's first triangle, in leaf order, and the leaf of the others.
fn first_of(at: u32) -> u32 { return at & 0x7fffffffu; }
fn others_of(at: u32) -> u32 { return NONE; }
