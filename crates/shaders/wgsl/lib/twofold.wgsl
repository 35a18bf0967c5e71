// Numbers of about 48 bits as exact sums of two floats. The second is at most half a last place of the first (Dekker 1971).

import package::lib::ieee::{add, mul, sub, upper_half};

// Three numbers, such as one coordinate of all corners of a triangle.
struct Twofold { high: vec3<f32>, low: vec3<f32> }

fn add_each(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return vec3<f32>(add(a.x, b.x), add(a.y, b.y), add(a.z, b.z)); }
fn sub_each(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return vec3<f32>(sub(a.x, b.x), sub(a.y, b.y), sub(a.z, b.z)); }
fn mul_each(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return vec3<f32>(mul(a.x, b.x), mul(a.y, b.y), mul(a.z, b.z)); }

// Returns the exact sum (Knuth).
fn exact_sum(a: vec3<f32>, b: vec3<f32>) -> Twofold {
    let sum = add_each(a, b);
    let of_b = sub_each(sum, a);
    return Twofold(sum, add_each(sub_each(a, sub_each(sum, of_b)), sub_each(b, of_b)));
}

// Returns the exact sum if the first number is zero or the larger in magnitude.
fn ordered_sum(a: vec3<f32>, b: vec3<f32>) -> Twofold {
    let sum = add_each(a, b);
    return Twofold(sum, sub_each(b, sub_each(sum, a)));
}

// Returns the exact product unless a part underflows, on devices whose fused multiply-add rounds once.
@if(FUSED)
fn exact_product(a: vec3<f32>, b: vec3<f32>) -> Twofold {
    let product = mul_each(a, b);
    return Twofold(product, fma(a, b, -product));
}

// Returns the exact product unless a part underflows. Products of halves are exact, and so is each difference.
@else
fn exact_product(a: vec3<f32>, b: vec3<f32>) -> Twofold {
    let product = mul_each(a, b);
    let a_high = vec3<f32>(upper_half(a.x), upper_half(a.y), upper_half(a.z));
    let b_high = vec3<f32>(upper_half(b.x), upper_half(b.y), upper_half(b.z));
    let a_low = sub_each(a, a_high);
    let b_low = sub_each(b, b_high);
    let rest = sub_each(sub_each(sub_each(product, mul_each(a_high, b_high)), mul_each(a_low, b_high)), mul_each(a_high, b_low));
    return Twofold(product, sub_each(mul_each(a_low, b_low), rest));
}

// The error is at most 3 * 2^-48 of |a| + |b|.
fn sum_of(a: Twofold, b: Twofold) -> Twofold {
    let sum = exact_sum(a.high, b.high);
    return ordered_sum(sum.high, add_each(sum.low, add_each(a.low, b.low)));
}

// The error is at most 5 * 2^-48 of the product.
fn product_of(a: Twofold, b: Twofold) -> Twofold {
    let product = exact_product(a.high, b.high);
    let crossed = add_each(mul_each(a.high, b.low), mul_each(a.low, b.high));
    return ordered_sum(product.high, add_each(product.low, crossed));
}

fn negative_of(a: Twofold) -> Twofold { return Twofold(-a.high, -a.low); }
