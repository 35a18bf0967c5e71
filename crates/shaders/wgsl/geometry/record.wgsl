// A triangle's record as rays read it; build/record.wgsl writes it.

import package::lib::buffers::records;

// The triangle of a record that no ray can hit.
const NO_TRIANGLE: u32 = 0xffffffffu;

struct Corners { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32 }

fn corners_of(leaf: u32) -> Corners {
    let first = records[3u * leaf];
    let x = bitcast<vec3<f32>>(first.xyz);
    let y = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz);
    let z = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz);
    return Corners(vec3<f32>(x.x, y.x, z.x), vec3<f32>(x.y, y.y, z.y), vec3<f32>(x.z, y.z, z.z), first.w);
}
