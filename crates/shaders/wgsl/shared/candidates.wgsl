// What is known of the shadows of an open hit's candidates, before it is known which of them is the hit.

// Candidates of a ray that are looked at, the first of its notes, and workgroups that take one each at a time.
const CANDIDATES: u32 = 8u;
const ABREAST: u32 = 4u;
// Of more rays than these, to seek the shadows of all candidates takes longer than to wait for the hits (an H200).
const MOST_RAYS: u32 = 512u;

// What a search and its notes say of a way to the light.
struct Sought { found: u32, said: Said }

// All of a workgroup call it.
fn seek_along(way: ToLight, ignore: u32, local: u32) -> Sought {
    var sought = Sought(search_together(way.traced, ray_to_light(way), ignore, local), Said());
    if sought.found != MET && sought.found != NO_NOTE {
        set_line_along(way);
        sought.said = said_by_notes(select(NO_NOTE, listed(sought.found), local < 16u), local);
    }
    return sought;
}

// What a search and its notes say of whether anything is met: 0, 1 or TOO_MANY.
fn known(sought: Sought) -> u32 {
    if sought.found == MET || sought.said.met { return 1u; }
    return select(0u, TOO_MANY, sought.found == TOO_MANY || sought.said.hard);
}

// The shadow of an open ray's hit, now that it is settled: 0, 1, or TOO_MANY if it is yet to be sought.
fn known_shadow(i: u32, hit: vec4<u32>) -> u32 {
    if hit.w == 0xffffffffu { return 0u; }
    var note = listed(occluded[i]);
    for (var c = 0u; c < CANDIDATES && note != NO_NOTE; c += 1u) {
        if records[3u * occluded[note_at(note)]].w == hit.w { return occluded[shadow_of(note)]; }
        note = occluded[note_at(note) + 1u];
    }
    return TOO_MANY;
}
