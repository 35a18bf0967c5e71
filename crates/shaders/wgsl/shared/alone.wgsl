// The four determinants of one triangle by one invocation alone.
fn decide_alone(leaf: u32, points: array<vec3<u32>, 3>) -> Concluded {
    let f = fixed(points);
    var made = Decided();
    made.leaf = leaf;
    made.hard = select(1u, 0u, f.fits);
    made.exponent = f.unit - line.shift - line.unit;
    var all = Four();
    if !f.fits { return Concluded(made, all.u, all.n); }
    for (var side = 0u; side < 4u; side += 1u) {
        let n = determinant(f, side);
        if side == 0u { all.u = n; }
        if side == 1u { all.v = n; }
        if side == 2u { all.w = n; }
        if side == 3u { all.n = n; }
    }
    return conclude(made, all);
}
