// Counts a ray whose search a driver ended before it was done: see turns.wgsl. Its hit is still to be written.
fn count_if_cut_short(i: u32) {
    if !loops_may_end() { return; }
    hits[i].x = 0u;
    for (var turn = params.zero; turn < 2u; turn += 1u) { hits[i].x += 1u; }
    if hits[i].x != 2u { atomicAdd(&counts[10], 1u); }
}
