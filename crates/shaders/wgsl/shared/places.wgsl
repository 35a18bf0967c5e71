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
