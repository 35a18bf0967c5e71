// Whether loops may end early: see turns.wgsl.
fn loops_may_end() -> bool { return params.bounded_loops != 0u; }
