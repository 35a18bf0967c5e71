// The corners of the root's box from a ray's start, and the greatest of their coordinates: D.
struct Root { low: vec3<f32>, high: vec3<f32>, reach: f32 }

// Who uses it declares `nodes`.
fn root_from(origin: vec3<f32>) -> Root {
    let low = bitcast<vec3<f32>>(nodes[0].xyz);
    let high = bitcast<vec3<f32>>(nodes[1].xyz);
    let to_low = vec3<f32>(sub(low.x, origin.x), sub(low.y, origin.y), sub(low.z, origin.z));
    let to_high = vec3<f32>(sub(high.x, origin.x), sub(high.y, origin.y), sub(high.z, origin.z));
    let away = max(abs(to_low), abs(to_high));
    return Root(to_low, to_high, max(away.x, max(away.y, away.z)));
}

// 2^80.
const FARTHEST: f32 = 1.2089258196146292e24;
