// Möller, Trumbore 1997, without culling and without its epsilon: it leaks near edges.
// In the device's own arithmetic, which may fuse and divide as it likes.

// Where the ray meets the leaf's triangle within its own box.
fn meet_leaf(ray: Prepared, leaf: u32) -> Meeting {
    let k = corners_of(leaf);
    let e1 = k.b - k.a;
    let e2 = k.c - k.a;
    let p = cross(ray.direction, e2);
    let inverse = 1.0 / dot(e1, p);
    let s = ray.origin - k.a;
    let u = dot(s, p) * inverse;
    let q = cross(s, e1);
    let v = dot(ray.direction, q) * inverse;
    // A determinant of zero makes u or v infinite or not a number: no hit.
    if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) { return NO_MEETING; }
    return within_box(ray, k.a, k.b, k.c, dot(e2, q) * inverse, u, v, k.triangle);
}
