//! use params {treelets.refit}
// Boxes of one level of treelets from the roots of the level below; of all treelets or of those that move.
// The last level, which is one treelet, also adds up the areas of all, as `sum_costs` does.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> costs: array<f32>;
// Word `destination`: the sum; word 5: the half area of the root; as f32.
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;

// Eight at a time, for each takes a while to come.
fn others(local: u32, number: u32) -> f32 {
    var sums = vec4<f32>(0.0);
    for (var i = local; i < params.first_group; i += 8u * GROUP) {
        sums += costs_of_others(i, number) + costs_of_others(i + 4u * GROUP, number);
    }
    return (sums.x + sums.y) + (sums.z + sums.w);
}

fn costs_of_others(first: u32, number: u32) -> vec4<f32> {
    let i = first + vec4<u32>(0u, GROUP, 2u * GROUP, 3u * GROUP);
    let at = min(i, vec4<u32>(params.first_group - 1u));
    let all = vec4<f32>(costs[at.x], costs[at.y], costs[at.z], costs[at.w]);
    return select(vec4<f32>(0.0), all, (i == at) & (i != vec4<u32>(number)));
}

// Writes what the tree costs; `own` is this treelet's sum, for invocation 0.
fn write_cost(t: Treelet, local: u32, own: f32, share: f32) {
    workgroupBarrier();
    let rest = sum_of_group(local, share);
    if local != 0u { return; }
    let root = topology[t.roots_at];
    counts[params.destination] = bitcast<u32>(own + rest);
    counts[5] = bitcast<u32>(half_area(low_of(root), high_of(root)));
}

@compute @workgroup_size(256)
fn refit_treelets(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let place = group.x + group.y * groups.x;
    if place >= params.count { return; }
    let number = treelet_at(place);
    let t = treelet(number);
    let inner = inner_word(t, local);
    let share = others(local, number);
    if local < t.leaf_count {
        let low = nodes[t.first_leaf + 2u * local];
        let high = nodes[t.first_leaf + 2u * local + 1u];
        keep_box(LEAVES + local, low.xyz, high.xyz);
        keep_leaf(local, low.w);
    }
    workgroupBarrier();
    let area = refit_treelet(t, local, inner);
    write_treelet(t, local);
    let sum = sum_of_group(local, area);
    if local == 0u { costs[number] = sum; }
    if params.first_group > 0u { write_cost(t, local, sum, share); }
}
