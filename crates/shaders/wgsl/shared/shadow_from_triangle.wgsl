// The way from a hit that was just found, by its triangle.

fn way_from(found: Found, hit: vec4<u32>, eye: vec3<f32>) -> ToLight { return to_light(hit, eye); }
