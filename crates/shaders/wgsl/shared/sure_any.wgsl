// Whether a ray surely meets a leaf's triangle. Where none is surely met but some may be, the ray is left to the
// kernels `settle_*`, in a list behind the words of all rays.

var<private> left_open: bool;

fn see_any(ray: Prepared, leaf: u32, ignore: u32) -> bool {
    let corners = corners_of(leaf);
    if corners.triangle == ignore { return false; }
    let j = judge(ray, corners);
    left_open = left_open || j.possible;
    return j.sure;
}

fn ask_any(ray: Prepared, ignore: u32) -> bool {
    left_open = ray.far;
    if ray.far { return false; }
    return find_any(ray, ignore);
}

// Writes whether a ray met anything, and counts it as word `count` of `counts`; lists it by `count + 5` if nobody knows yet.
fn keep_any(i: u32, met: bool, count: u32) {
    blocked[i] = select(0u, 1u, met);
    if met {
        atomicAdd(&counts[count], 1u);
    } else if left_open {
        blocked[params.first + atomicAdd(&counts[count + 5u], 1u)] = i;
    }
}
