// Counts a ray whose search a driver ended before it was done. Its answer is still to be written.
fn count_if_any_cut_short(i: u32) {
    if !loops_turn(i) { atomicAdd(&counts[10], 1u); }
}
