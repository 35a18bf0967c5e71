// Computes the boxes of treelets above those of triangles: one level per dispatch, or all levels in one dispatch.

import package::build::costs::{GROUP, half_area, partial_sums, sixteenth_sum, sum_of_group};
import package::build::treelet::{
    CHILDREN_IN_ENTRY, ENTRY_WORDS, LEAVES_OFFSET, PARENT_IN_ENTRY, ROOT_ROW_IN_ENTRY, Treelet, high_of, inner_word,
    load_treelet, low_of, refit_treelet, row_of, store_box, store_leaf_reference, treelet_of_dispatch, write_treelet,
};
import package::lib::buffers::{costs, counts, nodes, topology};
import package::lib::counters::ROOT_AREA;
import package::lib::params::params;

// Layout of `costs` for T treelets: T sums of half areas, then for each treelet the number of its children that have
// arrived, then eight words per root: lower corner, traversal reference, upper corner, 0. Only kernels that refit all
// levels in one dispatch count arrivals and store roots here.

// Refits a treelet whose leaves are roots of the level below. Each kind of kernel defines below where these roots are (`root_low`
// and `root_high`), where areas are (`cost_at` and `store_cost`), and how counts are written (`store_count`).

// Sums the areas of the other treelets. Reads eight at a time to hide memory latency.
fn sum_other_costs(local: u32, treelet_index: u32, sum_count: u32) -> f32 {
    var sums = vec4<f32>(0.0);
    for (var i = local; i < sum_count; i += 8u * GROUP) {
        sums += other_costs(i, treelet_index, sum_count) + other_costs(i + 4u * GROUP, treelet_index, sum_count);
    }
    return (sums.x + sums.y) + (sums.z + sums.w);
}

fn other_costs(first: u32, treelet_index: u32, sum_count: u32) -> vec4<f32> {
    let i = first + vec4<u32>(0u, GROUP, 2u * GROUP, 3u * GROUP);
    let at = min(i, vec4<u32>(sum_count - 1u));
    let areas = vec4<f32>(cost_at(at.x), cost_at(at.y), cost_at(at.z), cost_at(at.w));
    return select(vec4<f32>(0.0), areas, (i == at) & (i != vec4<u32>(treelet_index)));
}

// Returns two sums to invocation 0: of `x` over the workgroup, and of `part` over the first sixteen invocations. Adds
// in the order of `sum_of_group`.
fn group_sums(local: u32, x: f32, part: f32) -> vec2<f32> {
    partial_sums[local] = x;
    workgroupBarrier();
    let sum = sixteenth_sum(local);
    // No other invocation reads these two elements.
    if local < 16u {
        partial_sums[local] = sum;
        partial_sums[local + 16u] = part;
    }
    workgroupBarrier();
    var totals = vec2<f32>(0.0);
    if local == 0u {
        for (var k = 0u; k < 16u; k += 1u) { totals += vec2<f32>(partial_sums[k], partial_sums[k + 16u]); }
    }
    return totals;
}

// Refits a treelet from the roots of the level below. Returns two values. The first one is the half areas of the
// children that this invocation read. The second one is 0, except for the last treelet, whose root is that of the tree:
// there, it is this invocation's part of the sum over all other treelets, so that `sum_costs` is not needed.
// `sum_count` is the number of treelets for the last treelet, else 0. All invocations of the workgroup must call it.
fn refit_from_roots_below(t: Treelet, treelet_index: u32, local: u32, sum_count: u32) -> vec2<f32> {
    let inner = inner_word(treelet_index, local);
    // On these levels, `first_leaf` is the row of the first root below. All reads are issued before the first is waited for.
    let row = t.first_leaf + 2u * min(local, t.leaf_count - 1u);
    let low = root_low(row);
    let high = root_high(row);
    partial_sums[local] = sum_other_costs(local, treelet_index, sum_count);
    if local < t.leaf_count {
        store_box(LEAVES_OFFSET + local, low.xyz, high);
        store_leaf_reference(local, low.w);
    }
    workgroupBarrier();
    // The last treelet has an inner node, so a barrier follows before these values are overwritten.
    var part = 0.0;
    if sum_count > 0u { part = sixteenth_sum(local); }
    return vec2<f32>(refit_treelet(t, inner), part);
}

// Sums the results of a workgroup and stores them.
fn store_sums(t: Treelet, treelet_index: u32, local: u32, sum_count: u32, partials: vec2<f32>) {
    let root = topology[t.roots_at];
    let sums = group_sums(local, partials.x, partials.y);
    if local != 0u { return; }
    store_cost(treelet_index, sums.x);
    if sum_count > 0u {
        store_count(params.treelets.sum_counter, sums.x + sums.y);
        let root_area = half_area(bitcast<vec3<f32>>(low_of(root).xyz), bitcast<vec3<f32>>(high_of(root).xyz));
        store_count(ROOT_AREA, root_area);
    }
}

// One level per dispatch: boxes of treelets from the roots of the level below, for all treelets or for those that move.

@if(refit_treelets)
fn root_low(row: u32) -> vec4<u32> { return nodes[row]; }

@if(refit_treelets)
fn root_high(row: u32) -> vec3<u32> { return nodes[row + 1u].xyz; }

@if(refit_treelets)
fn cost_at(i: u32) -> f32 { return costs[i]; }

@if(refit_treelets)
fn store_cost(i: u32, cost: f32) { costs[i] = cost; }

@if(refit_treelets)
fn store_count(i: u32, x: f32) { counts[i] = bitcast<u32>(x); }

// Parameters: treelets.
// Loaded with every scene.
@compute @workgroup_size(256)
fn refit_treelets(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = group.x + group.y * groups.x;
    if index >= params.count { return; }
    let treelet_index = treelet_of_dispatch(index);
    let t = load_treelet(treelet_index);
    let partials = refit_from_roots_below(t, treelet_index, local, params.treelets.treelet_count);
    write_treelet(t, local);
    store_sums(t, treelet_index, local, params.treelets.treelet_count, partials);
}

// All treelets above those of triangles, in the same dispatch. The workgroup that arrives last at a parent continues with it, as
// in Karras 2012 (Maximizing Parallelism in the Construction of BVHs), section 4, but treelet by treelet. Workgroups exchange
// data through atomics, which bypass caches that are not coherent, and a device memory barrier.

const NO_PARENT: u32 = 0xffffffffu;

// The treelet to continue with.
var<workgroup> next_treelet: u32;

@if(!refit_treelets)
fn cost_at(i: u32) -> f32 { return bitcast<f32>(atomicLoad(&costs[i])); }

@if(!refit_treelets)
fn store_cost(i: u32, cost: f32) { atomicStore(&costs[i], bitcast<u32>(cost)); }

@if(!refit_treelets)
fn store_count(i: u32, x: f32) { atomicStore(&counts[i], bitcast<u32>(x)); }

// Returns the index in `costs` of the first word of the root at `row` of `nodes`. In `nodes`, the roots of all treelets
// except the last have contiguous rows. The first of these rows belongs to treelet 0.
fn words_of_root(row: u32) -> u32 { return 2u * params.treelets.treelet_count + 4u * (row - topology[ROOT_ROW_IN_ENTRY]); }

@if(!refit_treelets)
fn root_low(row: u32) -> vec4<u32> {
    let at = words_of_root(row);
    return vec4<u32>(
        atomicLoad(&costs[at]), atomicLoad(&costs[at + 1u]), atomicLoad(&costs[at + 2u]), atomicLoad(&costs[at + 3u]),
    );
}

@if(!refit_treelets)
fn root_high(row: u32) -> vec3<u32> {
    let at = words_of_root(row) + 4u;
    return vec3<u32>(atomicLoad(&costs[at]), atomicLoad(&costs[at + 1u]), atomicLoad(&costs[at + 2u]));
}

// A treelet's parent, and the number of the parent's children that arrive in this dispatch. Read early to hide latency.
var<private> parent: u32;
var<private> arriving_children: u32;

fn prefetch_parent(treelet_index: u32) {
    parent = topology[ENTRY_WORDS * treelet_index + PARENT_IN_ENTRY];
    arriving_children = 0u;
    if parent != NO_PARENT {
        arriving_children = topology[ENTRY_WORDS * parent + CHILDREN_IN_ENTRY + params.treelets.uses_list];
    }
}

// Passes a treelet's roots to its parent.
fn publish_roots(t: Treelet, local: u32) {
    for (var k = local; k < t.root_count; k += GROUP) {
        let place = topology[t.roots_at + k];
        let at = words_of_root(t.root_row + 2u * k);
        let low = row_of(t, place, false);
        let high = high_of(place);
        for (var i = 0u; i < 4u; i += 1u) {
            atomicStore(&costs[at + i], low[i]);
            atomicStore(&costs[at + 4u + i], high[i]);
        }
    }
}

// Returns the parent if all its other children have arrived, and resets its count for the next dispatch.
fn arrive_at_parent() -> u32 {
    let arrived = 1u + atomicAdd(&costs[params.treelets.treelet_count + parent], 1u);
    if arrived != arriving_children { return NO_PARENT; }
    atomicStore(&costs[params.treelets.treelet_count + parent], 0u);
    return parent;
}

// Ends a treelet whose boxes are complete, and continues upwards. All invocations of the workgroup must call it.
fn finish_and_refit_parents(first: u32, local: u32, area: f32) {
    let sum = sum_of_group(local, area);
    if local == 0u { store_cost(first, sum); }
    let last = params.treelets.treelet_count - 1u;
    var t = load_treelet(first);
    var treelet_index = first;
    while params.treelets.treelet_count > 1u && treelet_index != last {
        publish_roots(t, local);
        storageBarrier();
        // The boxes are written while the count is in flight.
        if local == 0u { next_treelet = arrive_at_parent(); }
        write_treelet(t, local);
        treelet_index = workgroupUniformLoad(&next_treelet);
        if treelet_index == NO_PARENT { return; }
        storageBarrier();
        prefetch_parent(treelet_index);
        t = load_treelet(treelet_index);
        let sum_count = select(0u, params.treelets.treelet_count, treelet_index == last);
        store_sums(t, treelet_index, local, sum_count, refit_from_roots_below(t, treelet_index, local, sum_count));
    }
    write_treelet(t, local);
}
