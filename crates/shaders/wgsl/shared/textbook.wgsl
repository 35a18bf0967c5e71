// What textbook tests share: a meeting is clamped to the triangle's own box, so that no tree can change it.

// Boxes decide hits, at each triangle that may be one.
fn inverse_for(ray: Prepared) -> vec3<f32> { return inverse_of(ray); }

struct Meeting { hit: bool, t: f32, u: f32, v: f32, triangle: u32 }

const NO_MEETING: Meeting = Meeting(false, 0.0, 0.0, 0.0, 0xffffffffu);

fn within_box(ray: Prepared, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, t: f32, u: f32, v: f32, triangle: u32) -> Meeting {
    let own = slab(ray, ray.inverse, min(min(a, b), c), max(max(a, b), c));
    return Meeting(own.x <= own.y, clamped(t, own), u, v, triangle);
}
