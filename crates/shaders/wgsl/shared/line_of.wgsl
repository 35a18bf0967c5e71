// The whole-number lines of rays given one by one.

fn set_given_line(i: u32) {
    let a = rays[2u * i];
    let b = rays[2u * i + 1u];
    set_line(a.xyz, b.xyz, a.w, b.w, 0);
}
