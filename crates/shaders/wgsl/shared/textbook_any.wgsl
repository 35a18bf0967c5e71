// Whether a textbook test meets a leaf's triangle.

fn intersect_leaf_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let m = meet_leaf(ray, leaf);
    return m.hit && m.triangle != ignore && m.t > ray.t_min && m.t < ray.t_max;
}
