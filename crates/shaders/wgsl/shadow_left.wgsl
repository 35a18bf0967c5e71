//! use params loops ieee divide exact units ray {intersector.settle} {layout.nodes} search_together settle_any to_light way shade line_to_light candidates
// The shadows of the hits that `trace_and_shadow_camera` left open, now that they are settled: what `settle_together_camera`
// found of those that were candidates; of others, sought by a workgroup a ray.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> blocked: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

fn keep_known(i: u32, met: u32) {
    blocked[i] = met;
    if met == 1u { atomicAdd(&counts[3], 1u); }
}

// Writes what a search found, or lists the ray as open.
fn keep(i: u32, sought: u32, whole: bool, said: Said) {
    let found = select(TOO_MANY, sought, whole);
    if found == MET || found == NO_NOTE {
        keep_known(i, select(0u, 1u, found == MET));
        return;
    }
    blocked[i] = found;
    blocked[params.destination + atomicAdd(&counts[OPEN_SHADOWS], 1u)] = i;
    if whole { settle_any(i, 3u, said); } else { atomicAdd(&counts[OPEN_SHADOWS + HARD], 1u); }
}

@compute @workgroup_size(64)
fn shadow_left(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    if 64u * number + local < params.places { empty_place(64u * number + local); }
    if local == 0u {
        open_rays = atomicLoad(&counts[OPEN_RAYS]);
        atomicStore(&whole_so_far, 0u);
        if number == 0u { atomicStore(&counts[OPEN_SHADOWS + LEFT], params.places); }
    }
    let open = workgroupUniformLoad(&open_rays);
    var round = 0u;
    for (var k = number; k < open; k += groups.x * groups.y) {
        let i = blocked[params.first + k];
        let hit = hits[i];
        if local == 0u { outcome = known_shadow(i, hit); }
        let told = workgroupUniformLoad(&outcome);
        if told != TOO_MANY {
            if local == 0u { keep_known(i, told); }
            continue;
        }
        let way = way_to_light(hit, scaled_point(bitcast<vec3<u32>>(params.eye)));
        let found = search_together(way.traced, ray_to_light(way), hit.w, local);
        var said = Said();
        if found != MET && found != NO_NOTE {
            set_line_along(way);
            said = said_by_notes(select(NO_NOTE, listed(found), local < 16u), local);
        }
        round += 1u;
        let whole = all_loops_turn(local, round);
        if local == 0u { keep(i, found, whole, said); }
    }
}
