// Refits and writes a treelet in workgroup memory: see bvh_layout::Treelets.

import package::build::costs::{GROUP, half_area};
import package::lib::buffers::{nodes, topology};
import package::lib::params::params;

// Number of words of a treelet's entry.
const ENTRY_WORDS: u32 = 12u;
// Words of an entry: see `load_treelet`.
const LEAF_COUNT_IN_ENTRY: u32 = 1u;
const INNER_AT_IN_ENTRY: u32 = 2u;
const INNER_COUNT_IN_ENTRY: u32 = 3u;
const ROOT_ROW_IN_ENTRY: u32 = 7u;
// Index of the treelet's parent.
const PARENT_IN_ENTRY: u32 = 9u;
// Number of the treelet's children. The next word is the number of its moving children. A child reads from its parent's
// entry how many children arrive at the parent.
const CHILDREN_IN_ENTRY: u32 = 10u;
// References within a treelet are below 512. They are also the indices of nodes in workgroup memory.
const NODE_CAPACITY: u32 = 512u;
// Index of a treelet's first leaf in workgroup memory. Inner nodes have the indices below.
const LEAVES_OFFSET: u32 = 256u;

// An entry: see bvh_layout::Treelet. The first inner node and the first root each have a word of `topology` (`*_at`)
// and a row of `nodes` (`*_row`). `height` is that of the highest inner node.
struct Treelet {
    // First leaf of the tree in this treelet. On higher levels, row of the first root below.
    first_leaf: u32,
    leaf_count: u32,
    inner_at: u32,
    inner_count: u32,
    inner_row: u32,
    roots_at: u32,
    root_count: u32,
    root_row: u32,
    height: u32,
}

// Returns the treelet at `index` of a dispatch.
fn treelet_of_dispatch(index: u32) -> u32 {
    let at = params.treelets.first + index;
    if params.treelets.uses_list == 1u { return topology[at]; }
    return at;
}

fn load_treelet(treelet_index: u32) -> Treelet {
    let at = ENTRY_WORDS * treelet_index;
    return Treelet(
        topology[at], topology[at + 1u], topology[at + 2u], topology[at + 3u], topology[at + 4u],
        topology[at + 5u], topology[at + 6u], topology[at + 7u], topology[at + 8u],
    );
}

// Boxes of all nodes, coordinate by coordinate, then the traversal reference of each leaf. Upper corners are offset by half a row
// of memory banks against lower ones, because both are read at once.
var<workgroup> treelet_nodes: array<u32, 3328>;

fn low_of(index: u32) -> vec4<u32> {
    return vec4<u32>(treelet_nodes[index], treelet_nodes[index + NODE_CAPACITY], treelet_nodes[index + 2u * NODE_CAPACITY], 0u);
}

fn high_of(index: u32) -> vec4<u32> {
    return vec4<u32>(
        treelet_nodes[(index ^ 16u) + 3u * NODE_CAPACITY],
        treelet_nodes[(index ^ 16u) + 4u * NODE_CAPACITY],
        treelet_nodes[(index ^ 16u) + 5u * NODE_CAPACITY],
        0u,
    );
}

fn store_box(index: u32, low: vec3<u32>, high: vec3<u32>) {
    treelet_nodes[index] = low.x;
    treelet_nodes[index + NODE_CAPACITY] = low.y;
    treelet_nodes[index + 2u * NODE_CAPACITY] = low.z;
    treelet_nodes[(index ^ 16u) + 3u * NODE_CAPACITY] = high.x;
    treelet_nodes[(index ^ 16u) + 4u * NODE_CAPACITY] = high.y;
    treelet_nodes[(index ^ 16u) + 5u * NODE_CAPACITY] = high.z;
}

fn store_leaf_reference(leaf: u32, reference: u32) {
    treelet_nodes[6u * NODE_CAPACITY + leaf] = reference;
}

fn leaf_reference(leaf: u32) -> u32 {
    return treelet_nodes[6u * NODE_CAPACITY + leaf];
}

// Computes the box at `index` as the union of two others. Returns their half areas.
fn merge_boxes(index: u32, left: u32, right: u32) -> f32 {
    let left_low = bitcast<vec3<f32>>(low_of(left).xyz);
    let left_high = bitcast<vec3<f32>>(high_of(left).xyz);
    let right_low = bitcast<vec3<f32>>(low_of(right).xyz);
    let right_high = bitcast<vec3<f32>>(high_of(right).xyz);
    let low = min(left_low, right_low);
    let high = max(left_high, right_high);
    store_box(index, bitcast<vec3<u32>>(low), bitcast<vec3<u32>>(high));
    return half_area(left_low, left_high) + half_area(right_low, right_high);
}

// Both child references, the index and the height of each inner node, as packed in `topology`.
var<workgroup> inner_words: array<u32, GROUP>;

// Returns the word of this invocation's inner node, or 0 if it has no inner node. Call it early to hide the latency of the reads.
fn inner_word(treelet_index: u32, local: u32) -> u32 {
    if local < topology[ENTRY_WORDS * treelet_index + INNER_COUNT_IN_ENTRY] {
        return topology[topology[ENTRY_WORDS * treelet_index + INNER_AT_IN_ENTRY] + local];
    }
    return 0u;
}

// Computes the boxes of inner nodes from those of leaves, which must be stored. Returns the half areas of the children that this
// invocation read. Must be called by all invocations with their words, in uniform control flow.
fn refit_treelet(t: Treelet, word: u32) -> f32 {
    let index = (word >> 18u) & 255u;
    let node_height = select((word >> 26u) + 1u, 0u, word == 0u);
    if word != 0u { inner_words[index] = word; }
    var area = 0.0;
    for (var height = 1u; height <= t.height; height += 1u) {
        if node_height == height { area = merge_boxes(index, word & 511u, (word >> 9u) & 511u); }
        workgroupBarrier();
    }
    return area;
}

// Returns one of the two rows of a node's box. The first one ends with the node's traversal reference.
fn row_of(t: Treelet, index: u32, high: bool) -> vec4<u32> {
    if high { return high_of(index); }
    var reference = (t.inner_row >> 2u) + index;
    if index >= LEAVES_OFFSET { reference = leaf_reference(index - LEAVES_OFFSET); }
    return vec4<u32>(low_of(index).xyz, reference);
}

// Writes inner nodes and roots. Neighbouring invocations write neighbouring rows.
fn write_treelet(t: Treelet, local: u32) {
    for (var row = local; row < 4u * t.inner_count; row += GROUP) {
        let word = inner_words[row >> 2u];
        let child = select(word, word >> 9u, (row & 2u) != 0u) & 511u;
        nodes[t.inner_row + row] = row_of(t, child, (row & 1u) != 0u);
    }
    for (var row = local; row < 2u * t.root_count; row += GROUP) {
        let root = topology[t.roots_at + (row >> 1u)];
        nodes[t.root_row + row] = row_of(t, root, (row & 1u) != 0u);
    }
}
