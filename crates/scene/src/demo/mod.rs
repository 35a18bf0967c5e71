//! Built-in scenes that need no files: `demo:NAME[:TRIANGLES]`.
//!
//! Scenes are bit-identical on all machines. All numbers are results of `libm` or of individual (not fused) IEEE
//! operations in double precision. Random numbers are hashes of seeds and indices. No result depends on the order in
//! which threads finish.

mod collide;
mod figure;
mod grove;
mod hall;
mod shapes;
mod shatter;
mod stage;
mod twist;

use crate::paging::{check_memory, with_more};
use crate::{Facts, Result, Scene, SceneError, SceneOptions};
use glam::DVec3;
use stage::{DemoPart, assemble};
use std::sync::Arc;

/// Maximum number of triangles of a demo. Beyond it, key frames alone exceed about 10 GB.
const MOST_TRIANGLES: usize = 100_000_000;

/// Minimum size of all key frames together, in bytes per triangle, for every demo.
const LEAST_BYTES: u64 = 96;

/// Demo: name, function from a triangle count to parts, default triangle count, and number of key frames.
type Demo = (&'static str, fn(usize) -> Vec<DemoPart>, usize, u32);

const DEMOS: [Demo; 5] = [
    ("grove", grove::build, 174_000, 24),
    ("collide", collide::build, 252_000, 24),
    // Fewer key frames than the others, to save memory: 16 take about 97 bytes per triangle, 24 would take 145.
    ("shatter", shatter::build, shatter::TRIANGLES, 16),
    ("twist", twist::build, 100_000, 24),
    ("hall", hall::build, 150_000, 24),
];

/// Opens the demo named by the text after `demo:`, such as `shatter` or `grove:5000`.
pub(crate) fn open(name: &str, options: &SceneOptions) -> Result<Scene> {
    let mut parts = name.splitn(2, ':');
    let (name, requested) = (parts.next().unwrap_or_default(), parts.next());
    let Some(&(name, build, default, keys)) = DEMOS.iter().find(|d| d.0 == name) else {
        let names = DEMOS.map(|d| d.0).join(", ");
        let unknown = format!("unknown demo {name:?}; there are {names}");
        return Err(SceneError(unknown));
    };
    let budget = requested.map_or(Ok(default), |text| triangles(name, text))?;
    let bytes = with_more(budget as u64 * LEAST_BYTES, budget, options);
    let what = format!("{budget} triangles");
    check_memory(format!("demo:{name}"), what, bytes)?;
    let (animation, colours) = assemble(build(budget), keys, options)?;
    let made = animation.triangle_count();
    let facts = Facts {
        format: "demo".to_owned(),
        notes: vec![format!("made {made} triangles, {budget} requested")],
        ..Facts::default()
    };
    Ok(Scene {
        name: name.to_owned(),
        animation: Arc::new(animation),
        colours: colours.into(),
        facts,
    })
}

fn triangles(demo: &str, text: &str) -> Result<usize> {
    let count = text.parse().ok();
    let count = count.filter(|n| (1..=MOST_TRIANGLES).contains(n));
    count.ok_or_else(|| {
        SceneError(format!(
            "bad triangle count {text:?} for demo:{demo}: give a whole number in 1..={MOST_TRIANGLES}"
        ))
    })
}

/// Returns a hash of (seed, index) by the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
fn hash(seed: u64, index: u64) -> u64 {
    let mut z = seed
        .wrapping_mul(0xd1b5_4a32_d192_ed03)
        .wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Returns a uniform random number in `0.0..1.0`.
fn unit(seed: u64, index: u64) -> f64 {
    (hash(seed, index) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Returns a uniform random number in `low..high`.
fn between(seed: u64, index: u64, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) * unit(seed, index)
}

/// Returns a direction that is uniform over the sphere.
fn direction(seed: u64, index: u64) -> DVec3 {
    let y = between(seed, index, [-1.0, 1.0]);
    let angle = std::f64::consts::TAU * unit(seed ^ 0xa5a5, index);
    let reach = (1.0 - y * y).max(0.0).sqrt();
    DVec3::new(reach * libm::cos(angle), y, reach * libm::sin(angle))
}

/// Returns smooth value noise in `-1.0..=1.0` with features of size 1.
fn noise(seed: u64, p: DVec3) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let w = f * f * (DVec3::splat(3.0) - 2.0 * f);
    let [x, y, z] = cell.to_array().map(|c| c as i64 as u64);
    let corner = |dx: u64, dy: u64, dz: u64| {
        let row = hash(
            hash(x.wrapping_add(dx), y.wrapping_add(dy)),
            z.wrapping_add(dz),
        );
        2.0 * unit(seed, row) - 1.0
    };
    let mix = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let along_x = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), w.x);
    let layer = |dz| mix(along_x(0, dz), along_x(1, dz), w.y);
    mix(layer(0), layer(1), w.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::refused;

    fn open(name: &str) -> Result<Scene> {
        super::open(name, &SceneOptions::default())
    }

    #[test]
    fn demos_are_checked_against_memory() {
        for (name, ..) in DEMOS {
            let animation = open(&format!("{name}:20000")).unwrap().animation;
            let bytes = 12 * animation.key_count() * animation.vertex_count();
            let each = bytes / animation.triangle_count();
            assert!(each as u64 >= LEAST_BYTES && each < 1000, "{name}: {each}");
        }
        let options = SceneOptions {
            more_bytes: 1 << 60,
            ..SceneOptions::default()
        };
        let large = super::open("twist:90000000", &options);
        refused(large, &["90000000 triangles: 1.2 EB of memory are needed"]);
    }

    fn fnv(scene: &Scene) -> u64 {
        let keys = scene.animation.all_keys().unwrap();
        let keys = keys.iter().flat_map(|key| key.as_flattened());
        let triangles = scene.animation.triangles().as_flattened().iter().copied();
        let colours = scene.colours.as_flattened().iter().map(|&c| u32::from(c));
        let words = keys.map(|x| x.to_bits()).chain(triangles).chain(colours);
        words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    #[test]
    fn demo_bits_are_platform_independent() {
        let found = DEMOS.map(|(name, ..)| fnv(&open(&format!("{name}:3000")).unwrap()));
        let expected = [
            0x5a06_e36d_ac7e_6e6a,
            0xc493_56bd_380c_c46b,
            0x1984_eaf7_8c05_dbd1,
            0xaaef_99e7_06b9_92e9,
            0x8b4c_4df4_e037_8ea0,
        ];
        assert_eq!(found, expected, "{found:#x?}");
    }

    #[test]
    fn demos_match_requested_triangle_counts() {
        let few = [1, 2, 7, 12, 40, 100, 300].map(|asked| (asked, 26));
        let many = [(2_000, 300), (20_000, 1_000), (100_000, 3_000)];
        for (name, ..) in DEMOS {
            for (asked, most_off) in few.into_iter().chain(many) {
                let scene = open(&format!("{name}:{asked}")).unwrap();
                let found = scene.animation.triangle_count();
                let least = if asked < 2_000 { 1 } else { asked - most_off };
                let good = (least..=asked + most_off).contains(&found);
                assert!(good, "{name}: {found} of {asked}");
                assert_eq!(scene.colours.len(), found);
                assert_eq!(scene.animation.live_count(), found);
                assert!((12..=24).contains(&scene.animation.key_count()));
                let keys = scene.animation.all_keys().unwrap();
                let mut coordinates = keys.iter().flat_map(|key| key.iter()).flatten();
                assert!(coordinates.all(|x| x.is_finite()));
            }
        }
    }
}
