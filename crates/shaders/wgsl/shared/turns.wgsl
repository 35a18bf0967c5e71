// Whether loops turn as often as they should. Software drivers of old count the turns of all loops that an invocation and
// its neighbours in the vector make, and after 65535 end every further loop after one turn, without a word. The count only
// rises: where this says yes, all loops before it were whole. Who keeps a result asks this after the last loop behind it.
//
// A loop that is ended so leaves by no way that the program has, and what its variables hold then is anything: only what
// stands in memory is sure. So the turns are counted there, in a word of this invocation's own.

fn loops_turn(word: u32) -> bool {
    if !loops_may_end() { return true; }
    blocked[word] = 0u;
    // Twice, which the compiler must not know.
    for (var i = unforeseen(word); i < 2u; i += 1u) { blocked[word] += 1u; }
    return blocked[word] == 2u;
}
