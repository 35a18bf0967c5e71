// The whole-number lines of pixels' rays, and those rays, by a pixel's number.

fn way_through(i: u32) -> vec3<f32> { return through_pixel(vec2<u32>(i % params.width, i / params.width)); }

fn set_line_of(i: u32) {
    set_line(bitcast<vec3<u32>>(params.eye), bitcast<vec3<u32>>(way_through(i)), 0u, 0x7f800000u, 0);
}

fn ray_of(i: u32) -> Prepared { return camera_ray(way_through(i), eye(), root_from(eye())); }
