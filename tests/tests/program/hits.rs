//! Files of hits: the same whatever tree, policy or thread count made them.

use crate::sandbox::{Sandbox, ensure, trial};
use integration::scenes::{REAL, Source};
use libtest_mimic::{Failed, Trial};
use npyz::npz::NpzArchive;
use std::io::Cursor;

pub(crate) fn trials() -> Vec<Trial> {
    let demos = ["demo:collide:2000", "demo:shatter:3000"];
    let of_demo = |demo: &'static str| {
        let name = format!("hits::no_policy_changes_them::{demo}");
        trial(&name, move |s| no_policy_changes_them(s, demo))
    };
    let of_scene = |scene: Source| {
        scene.trial("no_policy_changes_hits", |scene| {
            no_policy_changes_them(&Sandbox::new(), &scene.path()?)
        })
    };
    let mut trials: Vec<_> = demos.into_iter().map(of_demo).collect();
    trials.extend(REAL.into_iter().take(2).map(of_scene));
    trials.push(trial("hits::trace_repeats_render", trace_repeats_render));
    trials.push(trial(
        "hits::arrays_have_the_promised_types",
        promised_types,
    ));
    trials
}

/// Each with another number of threads than the one before.
const RUNS: [&str; 8] = [
    "rebuild --threads 2",
    "refit --threads 1",
    "t-sah --threads 2",
    "async --threads 1",
    "async --predict off --threads 2",
    "async --predict off --lockstep 3 --threads 1",
    "async --lockstep 0 --threads 2",
    "async --lockstep 7 --threads 1",
];

fn no_policy_changes_them(sandbox: &Sandbox, scene: &str) -> Result<(), Failed> {
    let frames = 10;
    let render = |out: &str, options: &str| {
        let words = format!("render {scene} --frames {frames} --size 40x30 --no-images --quiet");
        let run = sandbox.run(&format!("{words} --hits {out} --update {options}"));
        run.succeeds().map(|_| ())
    };
    render("expected", "rebuild --threads 1")?;
    for (i, options) in RUNS.into_iter().enumerate() {
        let out = format!("run-{i}");
        render(&out, options)?;
        for frame in 0..frames {
            let [a, b] =
                ["expected", &out].map(|d| sandbox.read(&format!("{d}/hits_{frame:04}.npz")));
            ensure(a == b, || format!("frame {frame} differs with {options}"))?;
        }
    }
    Ok(())
}

/// The rays that `render` writes, traced again: with a fresh tree, and with one of another time.
fn trace_repeats_render(sandbox: &Sandbox) -> Result<(), Failed> {
    let scene = "demo:collide:2000";
    let frame = "--time-range 7.25..9 --frames 2 --size 40x30 --no-images --quiet";
    let words = format!("render {scene} {frame} --hits . --rays-out rays.npy");
    sandbox.run(&words).succeeds()?;
    let expected = bits(sandbox, "hits_0000.npz")?;
    ensure(expected[0].iter().any(|&i| i != u32::MAX), || {
        "nothing is hit".into()
    })?;
    for options in [
        "",
        "--update refit --tree-time 0",
        "--update rebuild --threads 1",
    ] {
        let words = format!("trace {scene} --time 7.25 --rays rays.npy --out h.npz {options}");
        sandbox.run(&words).succeeds()?;
        let found = bits(sandbox, "h.npz")?;
        ensure(found == expected, || format!("other hits with `{options}`"))?;
    }
    let words = format!("trace {scene} --time 7.25 --rays rays.npy --out any.npz --any-hit");
    sandbox.run(&words).succeeds()?;
    let hit: Vec<u8> = array(sandbox, "any.npz", "hit")?.1;
    let met = expected[0].iter().map(|&i| u8::from(i != u32::MAX));
    ensure(met.eq(hit), || "any-hit disagrees".into())
}

fn promised_types(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "render demo:grove:1000 --frames 1 --size 7x5 --no-images --quiet --hits .";
    sandbox.run(words).succeeds()?;
    let (shape, triangle) = array::<u32>(sandbox, "hits_0000.npz", "triangle")?;
    ensure(shape == [5, 7], || format!("{shape:?}"))?;
    let (_, t) = array::<f32>(sandbox, "hits_0000.npz", "t")?;
    let (shape, shadow) = array::<u8>(sandbox, "hits_0000.npz", "shadow")?;
    ensure(shape == [5, 7], || format!("{shape:?}"))?;
    for i in 0..35 {
        let miss = triangle[i] == u32::MAX;
        ensure(miss == t[i].is_infinite(), || format!("t of ray {i}"))?;
        ensure(shadow[i] <= u8::from(!miss), || {
            format!("shadow of ray {i}")
        })?;
    }
    Ok(())
}

/// `triangle`, and `t`, `u`, `v` by their bits.
fn bits(sandbox: &Sandbox, file: &str) -> Result<[Vec<u32>; 4], Failed> {
    let bits = |name| -> Result<Vec<u32>, Failed> {
        let (_, xs) = array::<f32>(sandbox, file, name)?;
        Ok(xs.into_iter().map(f32::to_bits).collect())
    };
    let (_, triangle) = array(sandbox, file, "triangle")?;
    Ok([triangle, bits("t")?, bits("u")?, bits("v")?])
}

/// Shape and values of one array of a file.
pub(crate) fn array<T: npyz::Deserialize>(
    sandbox: &Sandbox,
    file: &str,
    name: &str,
) -> Result<(Vec<u64>, Vec<T>), Failed> {
    let mut archive = NpzArchive::new(Cursor::new(sandbox.read(file)))?;
    let array = archive
        .by_name(name)?
        .ok_or(format!("{file} has no {name}"))?;
    let shape = array.shape().to_vec();
    Ok((shape, array.into_vec()?))
}
