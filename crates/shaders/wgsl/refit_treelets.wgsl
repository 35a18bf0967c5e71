//! use params {treelets.refit} above
// Boxes of one level of treelets from the roots of the level below; of all treelets or of those that move.

@group(0) @binding(1) var<storage, read> topology: array<u32>;
@group(0) @binding(2) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> costs: array<f32>;
// Word `destination`: the sum; word 5: the half area of the root; as f32.
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;

fn low_below(row: u32) -> vec4<u32> { return nodes[row]; }
fn high_below(row: u32) -> vec3<u32> { return nodes[row + 1u].xyz; }
fn cost_at(i: u32) -> f32 { return costs[i]; }
fn keep_cost(i: u32, cost: f32) { costs[i] = cost; }
fn put_count(i: u32, x: f32) { counts[i] = bitcast<u32>(x); }

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
    let found = refit_above(t, number, local, params.first_group);
    write_treelet(t, local);
    add_up(t, number, local, params.first_group, found);
}
