// Whether the watertight test meets a leaf's triangle.

fn intersect_leaf_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = turned_corners(ray, leaf);
    let e = edges_of(ray, corners);
    if surely_passes(e) || corners.triangle == ignore { return false; }
    let span = span_of(ray, e);
    if span.x >= ray.t_max || span.y <= ray.t_min { return false; }
    if signs_stand(e) && begins_within(ray, span.x) && span.y < ray.t_max { return true; }
    let t = distance_to(ray, corners, e);
    return t > ray.t_min && t < ray.t_max;
}
