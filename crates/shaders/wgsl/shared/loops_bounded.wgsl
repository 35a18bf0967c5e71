// Whether loops may end early: see turns.wgsl.
fn loops_may_end() -> bool { return (params.bounded_loops | unforeseen(atomicLoad(&counts[0]))) != 0u; }
