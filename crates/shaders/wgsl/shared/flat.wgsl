// Whether corners make a triangle that rays can hit.

fn is_finite(v: vec3<u32>) -> bool {
    return all((v & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

// Whether scaling made a zero of a coordinate that was none.
fn lost_a_coordinate(before: vec3<u32>, after: vec3<f32>) -> bool {
    let was_zero = (before & vec3<u32>(0x7fffffffu)) == vec3<u32>(0u);
    return any((after == vec3<f32>(0.0)) != was_zero);
}

// Whether three finite corners are seen at once to span an area, as most are; also given in scaled units.
fn seen_to_have_area(
    given_a: vec3<u32>, given_b: vec3<u32>, given_c: vec3<u32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>,
) -> bool {
    let lost = lost_a_coordinate(given_a, a) || lost_a_coordinate(given_b, b) || lost_a_coordinate(given_c, c);
    return !lost && has_area(a, b, c);
}

// Whether they span none.
fn is_flat(given_a: vec3<u32>, given_b: vec3<u32>, given_c: vec3<u32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    if seen_to_have_area(given_a, given_b, given_c, a, b, c) { return false; }
    return is_degenerate(given_a, given_b, given_c);
}
