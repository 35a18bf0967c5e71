// Single IEEE operations. The build decorates each with NoContraction, so that
// no driver may fuse or regroup them.

fn add(a: f32, b: f32) -> f32 { return a + b; }
fn sub(a: f32, b: f32) -> f32 { return a - b; }
fn mul(a: f32, b: f32) -> f32 { return a * b; }
