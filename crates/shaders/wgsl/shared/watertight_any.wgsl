// Whether the watertight test meets a leaf's triangle.

fn see_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return false; }
    let c = intersect(ray, corners);
    if !c.hit { return false; }
    let own = own_span(ray, corners);
    if !(own.x <= own.y) { return false; }
    let rough = rough_span(c.t, c.det);
    if clamped(rough.x, own) > ray.t_min && clamped(rough.y, own) < ray.t_max { return true; }
    let t = clamped(divide(c.t, c.det), own);
    return t > ray.t_min && t < ray.t_max;
}
