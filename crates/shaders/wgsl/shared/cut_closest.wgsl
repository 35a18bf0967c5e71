// Whether a driver ended a ray's search before it was done: see turns.wgsl. Counts it then. Its hit is still to be written.
fn count_if_cut_short(i: u32) -> bool {
    if !loops_may_end() { return false; }
    hits[i].x = 0u;
    for (var turn = unforeseen(i); turn < 2u; turn += 1u) { hits[i].x += 1u; }
    if hits[i].x == 2u { return false; }
    atomicAdd(&counts[10], 1u);
    return true;
}
