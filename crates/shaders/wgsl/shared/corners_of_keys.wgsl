// A triangle's corners, blended from two key frames: bit for bit what `interpolate` writes.

@group(0) @binding(next) var<storage, read> earlier: array<u32>;
@group(0) @binding(next) var<storage, read> later: array<u32>;

struct Corners { a: vec3<u32>, b: vec3<u32>, c: vec3<u32> }

fn earlier_point(vertex: u32) -> vec3<u32> {
    let at = 3u * vertex;
    return vec3<u32>(earlier[at], earlier[at + 1u], earlier[at + 2u]);
}

fn later_point(vertex: u32) -> vec3<u32> {
    let at = 3u * vertex;
    return vec3<u32>(later[at], later[at + 1u], later[at + 2u]);
}

fn corners_of(vertices: vec3<u32>) -> Corners {
    let from_a = earlier_point(vertices.x);
    let from_b = earlier_point(vertices.y);
    let from_c = earlier_point(vertices.z);
    // At a key frame the bits are copied and the later frame is not read.
    if bitcast<u32>(params.alpha) == 0u { return Corners(from_a, from_b, from_c); }
    let to_a = later_point(vertices.x);
    let to_b = later_point(vertices.y);
    let to_c = later_point(vertices.z);
    let native = Corners(native_point(from_a, to_a), native_point(from_b, to_b), native_point(from_c, to_c));
    let rare = any_rare(from_a, to_a, native.a) || any_rare(from_b, to_b, native.b) || any_rare(from_c, to_c, native.c);
    if rare { return corners_again(vertices); }
    return native;
}

fn native_point(a: vec3<u32>, b: vec3<u32>) -> vec3<u32> {
    return vec3<u32>(blend_native(a.x, b.x), blend_native(a.y, b.y), blend_native(a.z, b.z));
}

fn any_rare(a: vec3<u32>, b: vec3<u32>, native: vec3<u32>) -> bool {
    return is_rare(a.x, b.x, native.x) || is_rare(a.y, b.y, native.y) || is_rare(a.z, b.z, native.z);
}

// The same where it is rarely asked for: a corner a turn, read again, so that this is there once and takes few registers.
fn corners_again(vertices: vec3<u32>) -> Corners {
    var made = Corners();
    var left = vertices;
    for (var i = 0u; i < 3u; i += 1u) {
        var point = earlier_point(left.x);
        if bitcast<u32>(params.alpha) != 0u {
            let to = later_point(left.x);
            point = vec3<u32>(blend(point.x, to.x), blend(point.y, to.y), blend(point.z, to.z));
        }
        made = Corners(made.b, made.c, point);
        left = left.yzx;
    }
    return made;
}
