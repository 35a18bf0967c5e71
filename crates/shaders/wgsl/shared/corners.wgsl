// A triangle's corners, from positions.

struct Corners { a: vec3<u32>, b: vec3<u32>, c: vec3<u32> }

fn point(vertex: u32) -> vec3<u32> {
    let at = 3u * vertex;
    return vec3<u32>(positions[at], positions[at + 1u], positions[at + 2u]);
}

fn corners_of(vertices: vec3<u32>) -> Corners {
    return Corners(point(vertices.x), point(vertices.y), point(vertices.z));
}

// The same where it is rarely asked for.
fn corners_again(vertices: vec3<u32>) -> Corners { return corners_of(vertices); }
