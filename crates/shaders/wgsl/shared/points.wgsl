// A triangle's corners in the scene's units, as bits.

fn points_of(triangle: u32) -> array<vec3<u32>, 3> {
    return array<vec3<u32>, 3>(
        point_of(triangles[3u * triangle]),
        point_of(triangles[3u * triangle + 1u]),
        point_of(triangles[3u * triangle + 2u]),
    );
}
