// Where a camera's rays start, in scaled units.

fn eye() -> vec3<f32> { return params.scaled_eye; }
