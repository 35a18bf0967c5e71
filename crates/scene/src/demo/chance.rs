//! Chance that is the same on every machine and in every order: hashes of names, not streams.

use glam::DVec3;

/// A well-mixed word for (seed, index): the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
pub(super) fn word(seed: u64, index: u64) -> u64 {
    let mut z = seed
        .wrapping_mul(0xd1b5_4a32_d192_ed03)
        .wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Evenly in `0.0..1.0`.
pub(super) fn unit(seed: u64, index: u64) -> f64 {
    (word(seed, index) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Evenly in `low..high`.
pub(super) fn between(seed: u64, index: u64, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * unit(seed, index)
}

/// A direction, evenly over the sphere.
pub(super) fn direction(seed: u64, index: u64) -> DVec3 {
    let y = between(seed, index, [-1.0, 1.0]);
    let angle = std::f64::consts::TAU * unit(seed ^ 0xa5a5, index);
    let reach = (1.0 - y * y).max(0.0).sqrt();
    DVec3::new(reach * libm::cos(angle), y, reach * libm::sin(angle))
}

/// Smooth value noise in `-1.0..=1.0` with features of size 1.
pub(super) fn noise(seed: u64, p: DVec3) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let w = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let [x, y, z] = cell.to_array().map(|c| c as i64 as u64);
    let corner = |dx: u64, dy: u64, dz: u64| {
        let row = word(
            word(x.wrapping_add(dx), y.wrapping_add(dy)),
            z.wrapping_add(dz),
        );
        2.0 * unit(seed, row) - 1.0
    };
    let mix = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let along_x = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), w.x);
    let layer = |dz| mix(along_x(0, dz), along_x(1, dz), w.y);
    mix(layer(0), layer(1), w.z)
}
