// Whether loops turn as often as they should. Software drivers of old count the turns of all loops that an invocation and
// its neighbours in the vector make, and after 65535 end every further loop after one turn, without a word. The count only
// rises: where this says yes, all loops before it were whole. Who keeps a result asks this after the last loop behind it.

fn loops_turn() -> bool {
    var turns = 0u;
    // Twice, which the compiler must not know.
    for (var i = params.zero; i < 2u; i += 1u) { turns += 1u; }
    return turns == 2u;
}
