// A triangle's record, as `record_corners.wgsl` writes it.

struct Corners { a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, triangle: u32 }

fn corners_of(leaf: u32) -> Corners {
    let first = records[3u * leaf];
    let x = bitcast<vec3<f32>>(first.xyz);
    let y = bitcast<vec3<f32>>(records[3u * leaf + 1u].xyz);
    let z = bitcast<vec3<f32>>(records[3u * leaf + 2u].xyz);
    return Corners(vec3<f32>(x.x, y.x, z.x), vec3<f32>(x.y, y.y, z.y), vec3<f32>(x.z, y.z, z.z), first.w);
}
