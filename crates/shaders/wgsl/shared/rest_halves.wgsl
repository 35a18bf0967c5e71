// What a quotient leaves: a - q * b. Products of halves are exact, and so is each difference if q is a / b but for a place or less (Dekker 1971).
fn rest_of_division(a: f32, q: f32, by: Divisor) -> f32 {
    let high = upper_half(q);
    let low = sub(q, high);
    return sub(sub(sub(sub(a, mul(high, by.high)), mul(high, by.low)), mul(low, by.high)), mul(low, by.low));
}
