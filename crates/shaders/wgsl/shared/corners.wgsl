// A triangle's corners, from positions.

@group(0) @binding(next) var<storage, read> positions: array<u32>;

struct Corners { a: vec3<u32>, b: vec3<u32>, c: vec3<u32> }

fn corners_of(vertices: vec3<u32>) -> Corners {
    return Corners(point_of(vertices.x), point_of(vertices.y), point_of(vertices.z));
}

// The same where it is rarely asked for.
fn corners_again(vertices: vec3<u32>) -> Corners { return corners_of(vertices); }
