// A list of open hits, shared by workgroups. Who uses it says what a ray's line is, and the ray: `set_line_of`, `ray_of`.

fn resolve_exact_hits(local: u32, number: u32, sharers: u32) {
    let open = begin_rounds(local, OPEN_RAYS);
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = occluded[params.first + k];
            list = listed(hits[i].y);
            set_line_of(i);
        }
        let leaf = first_of_notes(list, local);
        if k < open && local % 16u == 0u { resolve_exact_closest(i, ray_of(i), leaf); }
    }
}
