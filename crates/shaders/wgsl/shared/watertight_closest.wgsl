// What a search for the closest hit keeps of the leaves it sees: the watertight test's best.

// The weights are v / det and w / det.
struct Found { t: f32, v: f32, w: f32, det: f32, triangle: u32 }

fn nothing_found(ray: Prepared) -> Found { return Found(ray.t_max, 0.0, 0.0, 1.0, 0xffffffffu); }

// Nodes entered beyond this need no visit.
fn limit(found: Found) -> f32 { return found.t; }

// Tests the leaf's triangle and keeps it if it is the least by t, then by index.
fn see_closest(ray: Prepared, leaf: u32, best: Found) -> Found {
    let corners = corners_of(leaf);
    let c = intersect(ray, corners);
    if !c.hit { return best; }
    // The answer is clamped to the triangle's own box, so that no tree can change it.
    let own = own_span(ray, corners);
    let least = clamped(rough_span(c.t, c.det).x, own);
    if !(own.x <= own.y) || least > best.t { return best; }
    let t = clamped(divide(c.t, c.det), own);
    let inside = t > ray.t_min && t < ray.t_max;
    let before = t < best.t || (t == best.t && corners.triangle < best.triangle);
    if inside && before { return Found(t, c.v, c.w, c.det, corners.triangle); }
    return best;
}

// Writes a ray's hit, t in the ray's own units.
fn keep_closest(i: u32, ray: Prepared, best: Found) {
    count_if_cut_short(i);
    if best.triangle == 0xffffffffu {
        hits[i] = MISS;
        return;
    }
    let t = in_ray_units(best.t, ray.exponent);
    let by = divisor(best.det);
    let u = divide_by(best.v, by);
    let v = divide_by(best.w, by);
    hits[i] = vec4<u32>(t, bitcast<u32>(u), bitcast<u32>(v), best.triangle);
    atomicAdd(&counts[2], 1u);
}

// Every hit stands.
fn is_left_open(hit: vec4<u32>) -> bool { return false; }
