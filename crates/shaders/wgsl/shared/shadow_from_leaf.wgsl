// The way from a hit that was just found, by its leaf's record, which holds the corners.

fn way_from(found: Found, hit: vec4<u32>, eye: vec3<f32>) -> ToLight {
    let k = corners_of(found.leaf);
    return from_triangle(k.a, k.b, k.c, hit, eye);
}
