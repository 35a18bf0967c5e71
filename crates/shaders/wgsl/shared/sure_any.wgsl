// Whether a ray surely meets a leaf's triangle. Where none is surely met but some may be, the ray is left to the
// kernels `resolve_exact_*`, with notes of the triangles in question.

var<private> notes: u32 = NO_NOTE;

fn intersect_leaf_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return false; }
    let j = judge(ray, corners);
    if j.possible && !j.sure { notes = with_note(notes, leaf); }
    return j.sure;
}

fn ask_any(ray: Prepared, ignore: u32) -> bool {
    notes = NO_NOTE;
    set_view(ray);
    return find_any(ray, ignore);
}

// Writes whether a ray met anything, and counts it as word `count` of `counts`; lists it by `count + 5` from word
// `destination` on, with its notes, if nobody knows yet.
fn store_occluded(i: u32, met: bool, count: u32) {
    if met {
        occluded[i] = 1u;
        atomicAdd(&counts[count], 1u);
    } else if notes != NO_NOTE {
        occluded[i] = notes;
        occluded[params.destination + atomicAdd(&counts[count + 5u], 1u)] = i;
    } else {
        occluded[i] = 0u;
    }
}
