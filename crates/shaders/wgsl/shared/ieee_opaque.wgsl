// Single IEEE operations for translators that cannot promise NoContraction:
// each result passes through an integer xor with a zero that the compiler
// cannot know, so that nothing can be fused or regrouped across it.

fn opaque_zero(x: f32) -> f32 { return bitcast<f32>(bitcast<u32>(x) ^ params.zero); }
fn add(a: f32, b: f32) -> f32 { return opaque_zero(a + b); }
fn sub(a: f32, b: f32) -> f32 { return opaque_zero(a - b); }
fn mul(a: f32, b: f32) -> f32 { return opaque_zero(a * b); }
