// The whole-number lines of rays given one by one, and those rays.

fn set_line_of(i: u32) {
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    set_line(a.xyz, b.xyz, a.w, b.w, 0);
}

fn ray_of(i: u32) -> Prepared { return given_ray(i); }
