// A list of open any-hit queries, shared by workgroups. Who uses it says what a query's line is: `set_line_asked`.

// What is met is counted as word `count` of `counts`, what was left open as word `count + 5`.
fn resolve_exact_queries(local: u32, number: u32, sharers: u32, count: u32) {
    let open = begin_rounds(local, count + 5u);
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = occluded[params.destination + k];
            list = listed(occluded[i]);
            set_line_asked(i);
        }
        let said = said_by_notes(list, local);
        if k < open && local % 16u == 0u { resolve_exact_any(i, count, said); }
    }
}
