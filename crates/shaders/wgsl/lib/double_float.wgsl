// Double-float arithmetic: numbers of about 48 bits as unevaluated sums of two floats (Dekker 1971). The second float is at most
// half a unit in the last place of the first.

import package::lib::ieee::{add, mul, sub, upper_bits};

// Three numbers, such as one coordinate of all corners of a triangle.
struct DoubleFloat3 { high: vec3<f32>, low: vec3<f32> }

fn add_each(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return vec3<f32>(add(a.x, b.x), add(a.y, b.y), add(a.z, b.z)); }
fn sub_each(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return vec3<f32>(sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z)); }
fn mul_each(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return vec3<f32>(mul(a.x, b.x), mul(a.y, b.y), mul(a.z, b.z)); }

// Returns the exact sum (Knuth's TwoSum).
fn two_sum(a: vec3<f32>, b: vec3<f32>) -> DoubleFloat3 {
    let sum = add_each(a, b);
    let b_rounded = sub_each(sum, a);
    return DoubleFloat3(sum, add_each(sub_each(a, sub_each(sum, b_rounded)), sub_each(b, b_rounded)));
}

// Returns the exact sum if `a` is zero or not smaller in magnitude than `b` (Dekker's FastTwoSum).
fn fast_two_sum(a: vec3<f32>, b: vec3<f32>) -> DoubleFloat3 {
    let sum = add_each(a, b);
    return DoubleFloat3(sum, sub_each(b, sub_each(sum, a)));
}

// Returns the exact product unless a part underflows, on devices whose fused multiply-add rounds once.
@if(FUSED)
fn two_product(a: vec3<f32>, b: vec3<f32>) -> DoubleFloat3 {
    let product = mul_each(a, b);
    return DoubleFloat3(product, fma(a, b, -product));
}

// Returns the exact product unless a part underflows. Products of halves are exact, and so is each difference.
@else
fn two_product(a: vec3<f32>, b: vec3<f32>) -> DoubleFloat3 {
    let product = mul_each(a, b);
    let a_high = vec3<f32>(upper_bits(a.x), upper_bits(a.y), upper_bits(a.z));
    let b_high = vec3<f32>(upper_bits(b.x), upper_bits(b.y), upper_bits(b.z));
    let a_low = sub_each(a, a_high);
    let b_low = sub_each(b, b_high);
    let residual = sub_each(
        sub_each(sub_each(product, mul_each(a_high, b_high)), mul_each(a_low, b_high)), mul_each(a_high, b_low),
    );
    return DoubleFloat3(product, sub_each(mul_each(a_low, b_low), residual));
}

// The error is at most 3 * 2^-48 of |a| + |b|.
fn add_double(a: DoubleFloat3, b: DoubleFloat3) -> DoubleFloat3 {
    let sum = two_sum(a.high, b.high);
    return fast_two_sum(sum.high, add_each(sum.low, add_each(a.low, b.low)));
}

// The error is at most 5 * 2^-48 of the product.
fn multiply_double(a: DoubleFloat3, b: DoubleFloat3) -> DoubleFloat3 {
    let product = two_product(a.high, b.high);
    let cross_terms = add_each(mul_each(a.high, b.low), mul_each(a.low, b.high));
    return fast_two_sum(product.high, add_each(product.low, cross_terms));
}

fn negate_double(a: DoubleFloat3) -> DoubleFloat3 { return DoubleFloat3(-a.high, -a.low); }
