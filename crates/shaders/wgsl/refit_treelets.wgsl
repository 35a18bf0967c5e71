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

// Sixteen sums of what all invocations stored, for the first sixteen.
fn sixteenth(local: u32) -> f32 {
    var sum = 0.0;
    if local < 16u {
        for (var k = 0u; k < GROUP / 16u; k += 1u) { sum += partial_sums[local + 16u * k]; }
    }
    return sum;
}

// For invocation 0 the sum of `x` over the workgroup, and that of the first sixteen's `part`. As `sum_of_group`.
fn both_sums(local: u32, x: f32, part: f32) -> vec2<f32> {
    partial_sums[local] = x;
    workgroupBarrier();
    let sum = sixteenth(local);
    // Nobody else reads these two.
    if local < 16u {
        partial_sums[local] = sum;
        partial_sums[local + 16u] = part;
    }
    workgroupBarrier();
    var both = vec2<f32>(0.0);
    if local == 0u {
        for (var k = 0u; k < 16u; k += 1u) { both += vec2<f32>(partial_sums[k], partial_sums[k + 16u]); }
    }
    return both;
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
    let inner = inner_word(number, local);
    let root = topology[t.roots_at];
    // All that is read is asked for before any of it is waited for.
    let leaf = t.first_leaf + 2u * min(local, t.leaf_count - 1u);
    let low = nodes[leaf];
    let high = nodes[leaf + 1u];
    partial_sums[local] = others(local, number);
    if local < t.leaf_count {
        keep_box(LEAVES + local, low.xyz, high.xyz);
        keep_leaf(local, low.w);
    }
    workgroupBarrier();
    // Whoever adds up what all cost has an inner node, so there is a barrier before these are overwritten.
    var part = 0.0;
    if params.first_group > 0u { part = sixteenth(local); }
    let area = refit_treelet(t, inner);
    write_treelet(t, local);
    let sums = both_sums(local, area, part);
    if local != 0u { return; }
    costs[number] = sums.x;
    if params.first_group > 0u {
        counts[params.destination] = bitcast<u32>(sums.x + sums.y);
        counts[5] = bitcast<u32>(half_area(low_of(root), high_of(root)));
    }
}
