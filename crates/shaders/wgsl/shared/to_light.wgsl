// The way from a hit to the light, by the triangle's own vertices. Who uses it declares `triangles` and `positions`.

fn scaled(vertex: u32) -> vec3<f32> {
    let at = 3u * vertex;
    return scaled_point(vec3<u32>(positions[at], positions[at + 1u], positions[at + 2u]));
}

// All in scaled units: `eye` is where the ray that hit came from.
fn to_light(hit: vec4<u32>, eye: vec3<f32>) -> ToLight {
    let v0 = scaled(triangles[3u * hit.w]);
    let v1 = scaled(triangles[3u * hit.w + 1u]);
    let v2 = scaled(triangles[3u * hit.w + 2u]);
    return from_triangle(v0, v1, v2, hit, eye);
}
