// What a search for the exact closest hit keeps of the leaves it sees. Most rays are decided by it; the others it
// leaves to the kernels `resolve_exact_*`, with notes of the triangles in question.

// No candidate begins so late.
const NEVER: f32 = 3.4028234663852886e38;

// `bound` is the least high end of sure hits, `leaf` has it and begins at `low`; `other` is where the first of all others begins.
struct Found { bound: f32, low: f32, other: f32, leaf: u32, notes: u32 }

fn nothing_found(ray: Prepared) -> Found {
    set_view(ray);
    return Found(ray.t_max, NEVER, NEVER, NO_LEAF, NO_NOTE);
}

// Nodes entered beyond this need no visit.
fn limit(found: Found) -> f32 { return found.bound; }

fn intersect_leaf_closest(ray: Prepared, leaf: u32, found: Found) -> Found {
    let j = judge(ray, corners_of(leaf));
    if !j.possible || !(j.low <= found.bound) { return found; }
    if !(j.sure && j.high < found.bound) {
        return Found(found.bound, found.low, min(found.other, j.low), found.leaf, with_note(found.notes, leaf));
    }
    // The best so far begins no later than the new one ends.
    if found.leaf == NO_LEAF || found.low > j.high { return Found(j.high, j.low, found.other, leaf, found.notes); }
    return Found(j.high, j.low, min(found.other, found.low), leaf, with_note(found.notes, found.leaf));
}

// What is written for a ray: its hit, or what is known for whoever settles it.
fn hit_of(i: u32, ray: Prepared, found: Found) -> vec4<u32> {
    if found.other < NEVER && found.other <= found.bound {
        var notes = found.notes;
        if found.leaf != NO_LEAF { notes = with_note(notes, found.leaf); }
        return left_open(i, found.bound, notes);
    }
    if found.leaf == NO_LEAF { return MISS; }
    atomicAdd(&counts[2], 1u);
    return reported(ray, found.leaf, limits_of(i));
}

// Lists a ray. Nothing beyond `bound` is sought.
fn left_open(i: u32, bound: f32, list: u32) -> vec4<u32> {
    occluded[params.first + atomicAdd(&counts[OPEN_RAYS], 1u)] = i;
    return vec4<u32>(bitcast<u32>(bound), list, OPEN, 0u);
}

// Whether a hit is none yet.
fn is_unresolved(hit: vec4<u32>) -> bool { return hit.z == OPEN; }
