// Woop 2004: an affine transform makes each triangle the unit triangle. It leaks near edges.
// In the device's own arithmetic, which may fuse and divide as it likes.

// Where the ray meets the leaf's triangle within its own box.
fn meet_leaf(ray: Prepared, leaf: u32) -> Meeting {
    let to_u = bitcast<vec4<f32>>(records[3u * leaf]);
    let to_v = bitcast<vec4<f32>>(records[3u * leaf + 1u]);
    let to_height = bitcast<vec4<f32>>(records[3u * leaf + 2u]);
    let origin = vec4<f32>(ray.origin, 1.0);
    let t = -dot(to_height, origin) / dot(to_height.xyz, ray.direction);
    let u = fma(t, dot(to_u.xyz, ray.direction), dot(to_u, origin));
    let v = fma(t, dot(to_v.xyz, ray.direction), dot(to_v, origin));
    // A ray along the plane has a t that is infinite or not a number, and then u and v too: no hit.
    if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0) { return NO_MEETING; }
    // Behind all rows: see record_woop.wgsl.
    let triangle = records[3u * ((params.node_count + 1u) / 2u) + leaf / 4u][leaf & 3u];
    let p = points_of(triangle);
    return within_box(ray, scaled_point(p[0]), scaled_point(p[1]), scaled_point(p[2]), t, u, v, triangle);
}
