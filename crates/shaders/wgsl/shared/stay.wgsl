// Treelets of triangles alone.

@group(0) @binding(next) var<storage, read_write> costs: array<f32>;

fn look_ahead(number: u32) {}

// Ends a treelet, whose boxes stand. All of a workgroup call it.
fn leave(number: u32, local: u32, area: f32) {
    write_treelet(treelet(number), local);
    let sum = sum_of_group(local, area);
    if local == 0u { costs[number] = sum; }
}
