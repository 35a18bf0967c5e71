// Loops turn as often as they should.
fn loops_may_end() -> bool { return false; }
