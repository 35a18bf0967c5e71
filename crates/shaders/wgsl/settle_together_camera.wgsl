//! use params loops ieee divide exact units ray {intersector.settle} {layout.nodes} first settle_closest settle_any search_together camera seen to_light way shade line_to_light candidates
// All that `trace_and_shadow_camera` left open, at once: workgroups share the hits, as many share the shadows, and where open
// hits are few all others seek the shadows that they will have, a workgroup a candidate, so as not to wait for the hits.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

fn eye() -> vec3<f32> { return scaled_point(bitcast<vec3<u32>>(params.eye)); }

fn way_of_pixel(i: u32) -> vec3<f32> { return through_pixel(vec2<u32>(i % params.width, i / params.width)); }

fn settle_hits(local: u32, number: u32, sharers: u32) {
    let open = begin_settling(local, number, OPEN_RAYS);
    var round = 0u;
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        var direction = vec3<f32>(0.0);
        if k < open {
            i = blocked[params.first + k];
            list = listed(hits[i].y);
            direction = way_of_pixel(i);
            set_line(bitcast<vec3<u32>>(params.eye), bitcast<vec3<u32>>(direction), 0u, 0x7f800000u, 0);
        }
        let leaf = first_of_notes(list, local);
        round += 1u;
        let whole = all_loops_turn(local, round);
        if whole && k < open && local % 16u == 0u { settle_closest(i, camera_ray(direction, eye()), leaf); }
    }
}

fn settle_shadows(local: u32, number: u32, sharers: u32) {
    let open = begin_settling(local, number, OPEN_SHADOWS);
    var round = 0u;
    for (var first = RAYS * number; first < open; first += RAYS * sharers) {
        let k = first + local / 16u;
        var i = 0u;
        var list = NO_NOTE;
        if k < open {
            i = blocked[params.destination + k];
            list = listed(blocked[i]);
            set_line_along(way_to_light(hits[i], eye()));
        }
        let said = said_by_notes(list, local);
        round += 1u;
        let whole = all_loops_turn(local, round);
        if whole && k < open && local % 16u == 0u { settle_any(i, 3u, said); }
    }
}

// Whether the way from a candidate to the light is blocked, as its note will say.
fn seek_shadow(i: u32, note: u32, local: u32, round: u32) {
    let hit = reported(camera_ray(way_of_pixel(i), eye()), corners_of(blocked[note_at(note)]));
    let way = way_to_light(hit, eye());
    let found = search_together(way.traced, ray_to_light(way), hit.w, local);
    var said = Said();
    if found != MET && found != NO_NOTE {
        set_line_along(way);
        said = said_by_notes(select(NO_NOTE, listed(found), local < 16u), local);
    }
    let whole = all_loops_turn(local, round);
    if whole && local == 0u { blocked[shadow_of(note)] = known(found, said); }
}

fn seek_shadows(local: u32, number: u32, sharers: u32) {
    if local == 0u {
        open_rays = atomicLoad(&counts[OPEN_RAYS]);
        atomicStore(&whole_so_far, 0u);
    }
    let open = workgroupUniformLoad(&open_rays);
    if open > MOST_RAYS { return; }
    var round = 0u;
    for (var k = number / ABREAST; k < open; k += sharers / ABREAST) {
        let i = blocked[params.first + k];
        var note = note_after(listed(blocked[i]), number % ABREAST);
        for (var c = number % ABREAST; c < CANDIDATES && note != NO_NOTE; c += ABREAST) {
            round += 1u;
            seek_shadow(i, note, local, round);
            note = note_after(note, ABREAST);
        }
    }
}

@compute @workgroup_size(64)
fn settle_together_camera(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let sharers = params.first_group;
    if number < sharers {
        settle_hits(local, number, sharers);
    } else if number < 2u * sharers {
        settle_shadows(local, number - sharers, sharers);
    } else {
        seek_shadows(local, number - 2u * sharers, groups.x * groups.y - 2u * sharers);
    }
}
