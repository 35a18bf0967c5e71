// A triangle's record: its corners in scaled units, its index and its node.

struct Record { first: vec4<u32>, second: vec4<u32>, third: vec4<u32> }

// The record names the triangle itself.
fn keep_index(leaf: u32, triangle: u32) {}

fn record_of(triangle: u32, node: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Record {
    return Record(
        vec4<u32>(bitcast<vec3<u32>>(a), triangle),
        vec4<u32>(bitcast<vec3<u32>>(b), node),
        vec4<u32>(bitcast<vec3<u32>>(c), 0u),
    );
}
