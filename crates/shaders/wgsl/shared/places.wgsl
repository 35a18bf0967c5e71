// Where points are seen in the picture, and how far off that may be.

// 16 * 2^-24: how far a coordinate in the picture may be off, a unit of what it is made of. Farther out than so many pixels nobody looks closely.
const DOUBT: f32 = 9.5367431640625e-7;
const OUTER: f32 = 16384.0;

fn size_of(v: vec3<f32>) -> f32 { return abs(v.x) + abs(v.y) + abs(v.z); }

// Where points are seen along one axis of the picture, and how far each may be off.
struct Places { at: vec3<f32>, doubt: vec3<f32> }

fn loose_places(axis: vec3<f32>, x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, inverse: vec3<f32>, reach: f32) -> Places {
    let at = (axis.x * x + axis.y * y + axis.z * z) * inverse;
    let doubt = DOUBT * reach * (size_of(axis) + abs(at) * size_of(params.depth)) * inverse;
    return Places(at - 0.5, doubt);
}

fn is_near(p: Places) -> bool { return most_of(abs(p.at)) < OUTER && most_of(p.doubt) < 1.0; }

// Nearer than this depths may be off by more than a 64th.
fn too_near(reach: f32) -> f32 { return 64.0 * DOUBT * reach * size_of(params.depth); }

// Whether things surely lie beyond one side of the picture, which is told also of what reaches behind the eye: it is seen nowhere
// there, and of a column times its depth the sign tells on which side it is. Of a triangle by its corners.
fn is_triangle_beside(x: vec3<f32>, y: vec3<f32>, z: vec3<f32>, depths: vec3<f32>, reach: f32) -> bool {
    let across = params.column.x * x + params.column.y * y + params.column.z * z;
    let down = params.row.x * x + params.row.y * y + params.row.z * z;
    return are_beside(vec2<f32>(least_of(across - f32(params.width) * depths), most_of(across)), params.column, params.width, reach)
        || are_beside(vec2<f32>(least_of(down - f32(params.height) * depths), most_of(down)), params.row, params.height, reach);
}

// Of a box by its least and greatest corner.
fn is_box_beside(low: vec3<f32>, high: vec3<f32>, reach: f32) -> bool {
    return is_box_beside_along(low, high, params.column, params.width, reach) || is_box_beside_along(low, high, params.row, params.height, reach);
}

fn is_box_beside_along(low: vec3<f32>, high: vec3<f32>, axis: vec3<f32>, size: u32, reach: f32) -> bool {
    let last = axis - f32(size) * params.depth;
    let least = min(last * low, last * high);
    let most = max(axis * low, axis * high);
    return are_beside(vec2<f32>(least.x + least.y + least.z, most.x + most.y + most.z), axis, size, reach);
}

// By the least of what is seen less the picture's size, and the greatest of what is seen, both times depth.
fn are_beside(least_and_most: vec2<f32>, axis: vec3<f32>, size: u32, reach: f32) -> bool {
    let doubt = DOUBT * reach * (size_of(axis) + f32(size) * size_of(params.depth));
    return reach < FARTHEST && (least_and_most.x > doubt || least_and_most.y < -doubt);
}
