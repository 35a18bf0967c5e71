// The least and the greatest of three.

fn least_of(v: vec3<f32>) -> f32 { return min(min(v.x, v.y), v.z); }
fn most_of(v: vec3<f32>) -> f32 { return max(max(v.x, v.y), v.z); }
