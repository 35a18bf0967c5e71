// A camera's rays: geom::Camera::ray.

fn along(corner: f32, across: f32, down: f32, x: f32, y: f32) -> f32 {
    return add(add(corner, mul(x, across)), mul(y, down));
}

// The direction through the middle of a pixel.
fn through_pixel(pixel: vec2<u32>) -> vec3<f32> {
    let x = add(f32(pixel.x), 0.5);
    let y = add(f32(pixel.y), 0.5);
    return vec3<f32>(
        along(params.corner.x, params.across.x, params.down.x, x, y),
        along(params.corner.y, params.across.y, params.down.y, x, y),
        along(params.corner.z, params.across.z, params.down.z, x, y),
    );
}
