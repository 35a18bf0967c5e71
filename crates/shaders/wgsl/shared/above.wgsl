// Boxes of a treelet whose leaves are roots of the level below. Who uses it says where those stand: `low_below`, `high_below`;
// where areas do: `cost_at`, `keep_cost`; and how counts are written: `put_count`.

// Eight at a time, for each takes a while to come.
fn others(local: u32, number: u32, all: u32) -> f32 {
    var sums = vec4<f32>(0.0);
    for (var i = local; i < all; i += 8u * GROUP) {
        sums += costs_of_others(i, number, all) + costs_of_others(i + 4u * GROUP, number, all);
    }
    return (sums.x + sums.y) + (sums.z + sums.w);
}

fn costs_of_others(first: u32, number: u32, all: u32) -> vec4<f32> {
    let i = first + vec4<u32>(0u, GROUP, 2u * GROUP, 3u * GROUP);
    let at = min(i, vec4<u32>(all - 1u));
    let costs = vec4<f32>(cost_at(at.x), cost_at(at.y), cost_at(at.z), cost_at(at.w));
    return select(vec4<f32>(0.0), costs, (i == at) & (i != vec4<u32>(number)));
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

// The half areas of the children that this invocation read, and its part of the areas of all others: `all` treelets there are
// if this is the last of them, which adds up the areas of all, as `sum_costs` does; else 0. All of a workgroup call it.
fn refit_above(t: Treelet, number: u32, local: u32, all: u32) -> vec2<f32> {
    let inner = inner_word(number, local);
    // All that is read is asked for before any of it is waited for.
    let leaf = t.first_leaf + 2u * min(local, t.leaf_count - 1u);
    let low = low_below(leaf);
    let high = high_below(leaf);
    partial_sums[local] = others(local, number, all);
    if local < t.leaf_count {
        keep_box(LEAVES + local, low.xyz, high);
        keep_leaf(local, low.w);
    }
    workgroupBarrier();
    // Whoever adds up what all cost has an inner node, so there is a barrier before these are overwritten.
    var part = 0.0;
    if all > 0u { part = sixteenth(local); }
    return vec2<f32>(refit_treelet(t, inner), part);
}

// Adds up what a workgroup found, and keeps it.
fn add_up(t: Treelet, number: u32, local: u32, all: u32, found: vec2<f32>) {
    let root = topology[t.roots_at];
    let sums = both_sums(local, found.x, found.y);
    if local != 0u { return; }
    keep_cost(number, sums.x);
    if all > 0u {
        put_count(params.destination, sums.x + sums.y);
        put_count(5u, half_area(low_of(root), high_of(root)));
    }
}
