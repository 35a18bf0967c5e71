// A triangle's record: its corners in scaled units, a row an axis, so that who wants the axes in another order reads the
// rows in that order. Each row ends with the triangle's index.

struct Record { first: vec4<u32>, second: vec4<u32>, third: vec4<u32> }

fn row(triangle: u32, a: f32, b: f32, c: f32) -> vec4<u32> {
    return vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(a, b, c)), triangle);
}

// The record names the triangle itself.
fn keep_index(leaf: u32, triangle: u32) {}

fn record_of(triangle: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Record {
    return Record(row(triangle, a.x, b.x, c.x), row(triangle, a.y, b.y, c.y), row(triangle, a.z, b.z, c.z));
}
