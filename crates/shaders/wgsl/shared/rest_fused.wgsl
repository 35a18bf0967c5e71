// What a quotient leaves: a - q * b, exact if q is a / b but for a place or less, on devices that round a fused product and
// sum once.

fn rest_of_division(a: f32, q: f32, by: Divisor) -> f32 { return fma(-q, by.value, a); }
