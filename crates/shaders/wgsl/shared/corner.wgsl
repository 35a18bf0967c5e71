// One of a triangle's corners in the scene's units, as bits. Who uses it declares `triangles`.

fn corner(triangle: u32, which: u32) -> vec3<u32> { return point_of(triangles[3u * triangle + which]); }
