//! use params point corner
// Triangles as a driver's tree takes them, three vertices each: one with a corner that is not finite is drawn
// together to a point (`eye`), where no ray hits it. Drivers know inactive triangles too, but a tree cannot be updated
// when they change, and one driver (Mesa 25.0) loses others beside them.

@group(0) @binding(1) var<storage, read> triangles: array<u32>;
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read_write> cleansed: array<u32>;

fn is_finite(v: vec3<u32>) -> bool {
    return all((v & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

fn put(at: u32, v: vec3<u32>) {
    cleansed[at] = v.x;
    cleansed[at + 1u] = v.y;
    cleansed[at + 2u] = v.z;
}

@compute @workgroup_size(128)
fn cleanse(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let triangle = element(id, groups, 128u);
    if triangle >= params.count { return; }
    let a = corner(triangle, 0u);
    let b = corner(triangle, 1u);
    let c = corner(triangle, 2u);
    let hittable = is_finite(a) && is_finite(b) && is_finite(c);
    let point = bitcast<vec3<u32>>(params.eye);
    put(9u * triangle, select(point, a, hittable));
    put(9u * triangle + 3u, select(point, b, hittable));
    put(9u * triangle + 6u, select(point, c, hittable));
}
