// Whether the watertight test meets a leaf's triangle.

fn see_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    let g = glance(ray, corners);
    if g.passes || corners.triangle == ignore || g.low >= ray.t_max || g.high <= ray.t_min { return false; }
    // 2^-100: a t below that is zero.
    if g.sure && g.low > max(ray.t_min, 7.888609052210118e-31) && g.high < ray.t_max { return true; }
    let t = distance_to(ray, corners_of(leaf));
    return t > ray.t_min && t < ray.t_max;
}
