//! use params ieee rest divide exact units range root direction ray {intersector.settle} {layout.nodes} first resolve_exact_closest resolve_exact_any search_together camera eye seen pixel_line share_hits from_triangle to_light shade line_to_light share_any candidates
// All that `trace_and_shadow_camera` left open, at once: workgroups share the hits, as many share the shadows, and where open
// hits are few all others seek the shadows that they will have, a workgroup a candidate, so as not to wait for the hits.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

fn set_line_asked(i: u32) { set_line_along(to_light(hits[i], eye())); }

// Whether the way from a candidate to the light is occluded, as its note will say.
fn seek_shadow(i: u32, note: u32, local: u32) {
    let hit = reported(ray_of(i), occluded[note_at(note)], limits_of(i));
    let sought = seek_along(to_light(hit, eye()), hit.w, local);
    if local == 0u { occluded[shadow_of(note)] = known(sought); }
}

fn seek_shadows(local: u32, number: u32, sharers: u32) {
    let open = begin_rounds(local, OPEN_RAYS);
    if open > MOST_RAYS { return; }
    for (var k = number / ABREAST; k < open; k += sharers / ABREAST) {
        let i = occluded[params.first + k];
        var note = note_after(listed(occluded[i]), number % ABREAST);
        for (var c = number % ABREAST; c < CANDIDATES && note != NO_NOTE; c += ABREAST) {
            seek_shadow(i, note, local);
            note = note_after(note, ABREAST);
        }
    }
}

@compute @workgroup_size(64)
fn resolve_exact_together(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let sharers = params.first_group;
    if number < sharers {
        resolve_exact_hits(local, number, sharers);
    } else if number < 2u * sharers {
        resolve_exact_queries(local, number - sharers, sharers, 3u);
    } else {
        seek_shadows(local, number - 2u * sharers, groups.x * groups.y - 2u * sharers);
    }
}
