// Counts a ray whose search a driver ended before it was done.
fn count_if_cut_short() {
    if params.bounded_loops != 0u && !loops_turn() { atomicAdd(&counts[10], 1u); }
}
