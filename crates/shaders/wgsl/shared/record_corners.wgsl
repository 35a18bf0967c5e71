// A triangle's record: its corners in scaled units, its index and its node.

fn write_record(leaf: u32, node: u32, triangle: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) {
    records[3u * leaf] = vec4<u32>(bitcast<vec3<u32>>(a), triangle);
    records[3u * leaf + 1u] = vec4<u32>(bitcast<vec3<u32>>(b), node);
    records[3u * leaf + 2u] = vec4<u32>(bitcast<vec3<u32>>(c), 0u);
}
