// What becomes of an answer that rounded arithmetic gave.

// Writes whether a ray met anything, and counts it as word `count` of `counts`.
fn store_occluded(i: u32, met: bool, count: u32) {
    occluded[i] = select(0u, 1u, met);
    if met { atomicAdd(&counts[count], 1u); }
}

fn ask_any(ray: Prepared, ignore: u32) -> bool { return find_any(ray, ignore); }
