// Encoding of node references. The reference to an inner node is the index of a group of four rows of `nodes`: two
// for each child. A leaf node has one triangle, or two consecutive ones. Its reference contains the index of the first. In
// other files, `leaf` is the index of a single triangle in leaf order.

// No leaf.
const NO_LEAF: u32 = 0xffffffffu;
// No node. It has the flag of a leaf, with an index beyond all leaves.
const NO_NODE: u32 = 0xffffffffu;
// Flags: a leaf; a leaf of two triangles.
const LEAF: u32 = 0x80000000u;
const TWO_TRIANGLES: u32 = 0x40000000u;

// Returns the row of an inner node's left child. The right child is two rows further.
fn child_row(at: u32) -> u32 { return 4u * at; }

// Returns the index of a leaf's first triangle, in leaf order.
fn first_triangle_of(at: u32) -> u32 { return at & 0x3fffffffu; }

// Returns a reference to the second triangle of a leaf of two, else NO_NODE.
fn second_triangle_of(at: u32) -> u32 { return select(NO_NODE, LEAF | (first_triangle_of(at) + 1u), (at & TWO_TRIANGLES) != 0u); }
