//! use params ieee rest divide exact units range root direction ray {intersector.settle} {layout.nodes} search_together resolve_exact_any eye from_triangle to_light shade line_to_light candidates
// The shadows of the hits that `trace_and_shadow_camera` left open, now that they are settled: what `resolve_exact_together`
// found of those that were candidates; of others, sought by a workgroup a ray.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> records: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> hits: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> occluded: array<u32>;
@group(0) @binding(6) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> positions: array<u32>;

// Writes what a search found, or lists the ray as open.
fn keep(i: u32, sought: Sought) {
    let found = sought.found;
    if found == MET || found == NO_NOTE {
        answer_any(i, found == MET, 3u);
        return;
    }
    occluded[i] = found;
    occluded[params.destination + atomicAdd(&counts[OPEN_SHADOWS], 1u)] = i;
    resolve_exact_any(i, 3u, sought.said);
}

@compute @workgroup_size(64)
fn shadow_left(@builtin(local_invocation_index) local: u32, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let number = group.x + group.y * groups.x;
    let open = begin_rounds(local, OPEN_RAYS);
    for (var k = number; k < open; k += groups.x * groups.y) {
        let i = occluded[params.first + k];
        let hit = hits[i];
        if local == 0u { outcome = known_shadow(i, hit); }
        let told = workgroupUniformLoad(&outcome);
        if told != TOO_MANY {
            if local == 0u { answer_any(i, told == 1u, 3u); }
            continue;
        }
        let sought = seek_along(to_light(hit, eye()), hit.w, local);
        if local == 0u { keep(i, sought); }
    }
}
