//! Scenes that need no file: `demo:NAME[:TRIANGLES]`.
//!
//! Bit-equal on every machine: every number comes from `libm` or from single
//! IEEE operations in double precision, chance is a hash of names, and
//! nothing depends on the order in which threads finish.

mod chance;
mod collide;
mod figure;
mod grove;
mod hall;
mod shapes;
mod shatter;
mod stage;
mod twist;

use crate::mesh::{check_memory, with_more};
use crate::{Facts, Options, Result, Scene, SceneError};
use stage::{Part, assemble};
use std::sync::Arc;

/// The most triangles a demo is made of: beyond this the key frames alone pass ten gigabytes.
const MOST_TRIANGLES: usize = 100_000_000;

/// The least that a triangle of any demo takes in all key frames.
const LEAST_BYTES: u64 = 96;

/// A demo: its parts for so many triangles, how many these are unless asked otherwise, and how many key frames it has.
type Demo = (&'static str, fn(usize) -> Vec<Part>, usize, u32);

const DEMOS: [Demo; 5] = [
    ("grove", grove::build, 174_000, 24),
    ("collide", collide::build, 252_000, 24),
    // Few key frames, so that ten million triangles stay under 200 bytes each.
    ("shatter", shatter::build, shatter::TRIANGLES, 16),
    ("twist", twist::build, 100_000, 24),
    ("hall", hall::build, 150_000, 24),
];

/// The demo named by what follows `demo:`, such as `shatter` or `grove:5000`.
pub(crate) fn open(name: &str, options: &Options) -> Result<Scene> {
    let mut parts = name.splitn(2, ':');
    let (name, asked) = (parts.next().unwrap_or_default(), parts.next());
    let Some(&(name, build, default, keys)) = DEMOS.iter().find(|d| d.0 == name) else {
        let names = DEMOS.map(|d| d.0).join(", ");
        let unknown = format!("unknown demo {name:?}; there are {names}");
        return Err(SceneError(unknown));
    };
    let budget = asked.map_or(Ok(default), |text| triangles(name, text))?;
    let bytes = with_more(budget as u64 * LEAST_BYTES, budget, options);
    let what = format!("{budget} triangles");
    check_memory(format_args!("demo:{name}"), what, bytes, options)?;
    let (animation, colours) = assemble(build(budget), keys, options)?;
    let made = animation.triangle_count();
    let facts = Facts {
        format: "demo".to_owned(),
        notes: vec![format!("{made} triangles made, {budget} asked for")],
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

#[cfg(test)]
mod tests {
    use super::*;

    fn open(name: &str) -> Result<Scene> {
        super::open(name, &Options::default())
    }

    #[test]
    fn a_demo_takes_at_least_what_is_asked_for_it_and_is_refused_where_that_is_too_much() {
        for (name, ..) in DEMOS {
            let animation = open(&format!("{name}:20000")).unwrap().animation;
            let bytes = 12 * animation.key_count() * animation.vertex_count();
            let each = bytes / animation.triangle_count();
            assert!(each as u64 >= LEAST_BYTES && each < 1000, "{name}: {each}");
        }
        let memory = Some(1 << 30);
        let options = Options {
            memory,
            ..Options::default()
        };
        let e = super::open("twist:90000000", &options).unwrap_err();
        assert!(e.to_string().contains("1.1 GB are free"), "{e}");
    }

    fn fnv(scene: &Scene) -> u64 {
        let keys = scene.animation.all_keys().unwrap();
        let keys = keys
            .iter()
            .flat_map(|key| key.as_flattened())
            .map(|x| x.to_bits());
        let triangles = scene.animation.triangles().iter().flatten().copied();
        let colours = scene.colours.iter().flatten().map(|&c| u32::from(c));
        keys.chain(triangles)
            .chain(colours)
            .fold(0xcbf2_9ce4_8422_2325, |hash, word| {
                (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
            })
    }

    #[test]
    fn demos_have_the_same_bits_everywhere() {
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
    fn every_demo_meets_its_count_and_is_finite() {
        let few = [1, 2, 7, 12, 40, 100, 300].map(|asked| (asked, 26));
        let many = [(2_000, 300), (20_000, 1_000), (100_000, 3_000)];
        for (name, ..) in DEMOS {
            for (asked, most_off) in few.into_iter().chain(many) {
                let scene = open(&format!("{name}:{asked}")).unwrap();
                let found = scene.animation.triangle_count();
                assert!(
                    found > 0 && found <= asked + most_off,
                    "{name}: {found} of {asked}"
                );
                assert!(
                    asked < 2_000 || found >= asked - most_off,
                    "{name}: {found} of {asked}"
                );
                assert_eq!(scene.colours.len(), found);
                assert_eq!(scene.animation.live_count(), found);
                assert!((12..=24).contains(&scene.animation.key_count()));
                assert!(scene.animation.magnitude().is_finite());
            }
        }
    }
}
