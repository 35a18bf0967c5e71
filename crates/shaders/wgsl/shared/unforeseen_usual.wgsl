// Zero.
fn unforeseen(x: u32) -> u32 { return 0u; }
