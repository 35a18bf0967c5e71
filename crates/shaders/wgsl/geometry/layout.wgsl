// Encoding of node references in both layouts. `bvh2`: two rows per node, siblings adjacent, one triangle per leaf.
// `fast`: four rows per inner node, which hold both children's boxes, and one or two triangles per leaf.
//
// Kernels that trace few rays are compiled for both layouts at once and read the layout from the parameters.

import package::lib::params::params;

// No leaf.
const NO_LEAF: u32 = 0xffffffffu;
// No node. Read as a leaf, it would come after all others.
const NONE: u32 = 0xffffffffu;
// Flags: a leaf; a leaf of two triangles.
const LEAF: u32 = 0x80000000u;
const TWO: u32 = 0x40000000u;

// Returns the row of an inner node's left child. The right child is two rows further.
@if(FAST)
fn children_of(at: u32) -> u32 { return 4u * at; }
@elif(BVH2)
fn children_of(at: u32) -> u32 { return 2u * at; }
@else
fn children_of(at: u32) -> u32 { return (2u + 2u * params.fast_layout) * at; }

// Returns a leaf's first triangle, in leaf order.
@if(FAST)
fn first_of(at: u32) -> u32 { return at & 0x3fffffffu; }
@elif(BVH2)
fn first_of(at: u32) -> u32 { return at & 0x7fffffffu; }
@else
fn first_of(at: u32) -> u32 { return at & select(0x7fffffffu, 0x3fffffffu, params.fast_layout == 1u); }

// Returns a reference to the second triangle of a leaf of two, else NONE.
@if(FAST)
fn others_of(at: u32) -> u32 { return select(NONE, LEAF | (first_of(at) + 1u), (at & TWO) != 0u); }
@elif(BVH2)
fn others_of(at: u32) -> u32 { return NONE; }
@else
fn others_of(at: u32) -> u32 {
    return select(NONE, LEAF | (first_of(at) + 1u), params.fast_layout == 1u && (at & TWO) != 0u);
}
