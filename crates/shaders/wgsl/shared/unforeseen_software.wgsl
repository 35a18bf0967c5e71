// Zero, which the compiler does not know. Software drivers of Mesa make a kernel anew, and keep it, for each dispatch whose
// parameters alone decide a branch or how often a loop turns; so something else takes part in it.
fn unforeseen(x: u32) -> u32 { return params.zero & x; }
