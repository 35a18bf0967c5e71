// Where a camera's rays start, in scaled units.

fn eye() -> vec3<f32> { return scaled_point(bitcast<vec3<u32>>(params.eye)); }
