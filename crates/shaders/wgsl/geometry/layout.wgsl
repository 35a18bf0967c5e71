// How the layouts of a tree say what follows a node: `bvh2` has two rows a node, siblings side by side, and one triangle a leaf;
// `fast` has inner nodes of four rows, which hold both children's boxes, and one triangle a leaf or two.
//
// Kernels that search for few rays are made for both layouts at once, and ask the parameters.

import package::lib::params::params;

// No leaf at all.
const NO_LEAF: u32 = 0xffffffffu;
// No node at all; as a leaf it would be beyond all others.
const NONE: u32 = 0xffffffffu;
// Flags a leaf, and one of two triangles.
const LEAF: u32 = 0x80000000u;
const TWO: u32 = 0x40000000u;

// The row of an inner node's left child; the right one's is two on.
@if(FAST)
fn children_of(at: u32) -> u32 { return 4u * at; }
@elif(BVH2)
fn children_of(at: u32) -> u32 { return 2u * at; }
@else
fn children_of(at: u32) -> u32 { return (2u + 2u * params.fast_layout) * at; }

// A leaf's first triangle, in leaf order.
@if(FAST)
fn first_of(at: u32) -> u32 { return at & 0x3fffffffu; }
@elif(BVH2)
fn first_of(at: u32) -> u32 { return at & 0x7fffffffu; }
@else
fn first_of(at: u32) -> u32 { return at & select(0x7fffffffu, 0x3fffffffu, params.fast_layout == 1u); }

// The leaf of a leaf's other triangles.
@if(FAST)
fn others_of(at: u32) -> u32 { return select(NONE, LEAF | (first_of(at) + 1u), (at & TWO) != 0u); }
@elif(BVH2)
fn others_of(at: u32) -> u32 { return NONE; }
@else
fn others_of(at: u32) -> u32 {
    return select(NONE, LEAF | (first_of(at) + 1u), params.fast_layout == 1u && (at & TWO) != 0u);
}
