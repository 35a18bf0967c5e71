//! `bench`: a table for people, and every frame of every run for programs.

use crate::devices::{BACKENDS, HOST};
use crate::sandbox::{Sandbox, ensure, trial};
use crate::stats::FRAME;
use libtest_mimic::{Failed, Trial};
use serde_json::Value;

pub(crate) fn trials() -> Vec<Trial> {
    let warm = BACKENDS.into_iter().chain([HOST]).map(|backend| {
        let name = format!("bench::{}::a_warm_up_shows_in_no_frame", backend.name);
        backend.trial(&name, move |s| warm_up(s, backend.name))
    });
    let others = vec![
        trial("bench::the_file_holds_every_frame_and_the_machine", file),
        trial("bench::what_moves_is_counted_in_every_input", moving),
        trial("bench::what_is_not_there_is_refused", refused),
        trial("bench::rays_at_random_have_rows_of_their_own", random_rays),
    ];
    let memory = BACKENDS.into_iter().map(|backend| {
        let name = format!("bench::{}::memory_is_told_by_what_it_holds", backend.name);
        backend.trial(&name, move |s| memory(s, backend.name))
    });
    warm.chain(memory).chain(others).collect()
}

/// Whatever the device did between the first frame and the others, they are the same.
fn warm_up(sandbox: &Sandbox, backend: &str) -> Result<(), Failed> {
    let updates = match backend {
        "cpu" => "refit",
        _ => "refit,device-rebuild",
    };
    let rows = |seconds: &str| -> Result<Vec<Value>, Failed> {
        let what = format!("bench demo:collide:600 --backend {backend} --update {updates}");
        let how = format!("--frames 4 --size 16x12 --layout bvh2 --warm-up {seconds}");
        sandbox
            .run(&format!("{what} {how} --quiet --json w.json"))
            .succeeds()?;
        let mut json = sandbox.json("w.json")?;
        let rows = json["rows"].as_array_mut().ok_or("no rows")?;
        Ok(std::mem::take(rows))
    };
    let facts = |row: &Value| -> Vec<Vec<Value>> {
        let names = [
            "time",
            "hits",
            "blocked",
            "tree_generation",
            "tree_age_frames",
            "adopted",
        ];
        let frames = row["per_frame"].as_array().map_or(&[][..], Vec::as_slice);
        let of = |f: &Value| names.map(|n| f[n].clone()).to_vec();
        frames.iter().map(of).collect()
    };
    let (cold, warm) = (rows("0")?, rows("0.2")?);
    for (cold, warm) in cold.iter().zip(&warm) {
        let same = facts(cold) == facts(warm) && facts(warm).len() == 4;
        ensure(same, || format!("{cold:#} {warm:#}"))?;
        ensure(cold.get("warm_up").is_none(), || "unasked".into())?;
        let told = &warm["warm_up"];
        let (seconds, frames) = (told["seconds"].as_f64(), told["frames"].as_u64());
        let right = match backend {
            "cpu" => told.is_null(),
            _ => seconds >= Some(0.2) && frames >= Some(2) && told["steady"].is_boolean(),
        };
        ensure(right, || told.to_string())?;
    }
    Ok(())
}

/// A tree with its records takes at most 160 bytes a triangle, whoever makes it.
fn memory(sandbox: &Sandbox, backend: &str) -> Result<(), Failed> {
    let words = "--update refit,device-rebuild --layout fast --frames 3 --size 16x12 --quiet";
    let what = format!("bench demo:twist:20000 --backend {backend} --json m.json {words}");
    sandbox.run(&what).succeeds()?;
    let json = sandbox.json("m.json")?;
    let part = |row: usize, name: &str| {
        let each = &json["rows"][row]["memory"]["bytes_per_triangle"];
        each[name].as_f64().unwrap_or(f64::NAN)
    };
    for (row, scratch) in [(0, 0.0..20.0), (1, 40.0..80.0)] {
        let known = [
            (80.0..160.0).contains(&part(row, "tree")),
            scratch.contains(&part(row, "scratch")),
            // Vertices are half as many as triangles: so many key frames, and two buffers of positions.
            (100.0..200.0).contains(&part(row, "scene")),
            (0.0..100.0).contains(&part(row, "frames")),
        ];
        ensure(known == [true; 4], || {
            json["rows"][row]["memory"].to_string()
        })?;
    }
    Ok(())
}

/// A scene of two halls has twice the triangles, and twice those that move.
fn moving(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "--backend cpu --update refit --frames 2 --size 8x8 --quiet --json m.json";
    let two = "demo:hall:2000+demo:hall:2000@0,0,9.5*0.5";
    sandbox.run(&format!("bench {two} {words}")).succeeds()?;
    let json = sandbox.json("m.json")?;
    let row = &json["rows"][0];
    let one = scene::open("demo:hall:2000", &scene::Options::default())?.animation;
    let (moving, all) = (one.moving_count(), one.triangle_count());
    let twice = row["moving"] == 2 * moving && row["triangles"] == 2 * all;
    ensure(moving > 0 && moving * 10 < all && twice, || row.to_string())
}

const SMALL: &str = "bench demo:twist:500 --backend cpu --size 16x12 --quiet";

fn file(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "--frames 5 --time-range 1..1.5 --update refit,async --against async --json b.json";
    let run = sandbox.run(&format!("{SMALL} {words}")).succeeds()?;
    for part in [
        "geometry",
        "wall",
        "age",
        "SAH",
        "cpu: ",
        "times over those of cpu async",
    ] {
        ensure(run.stdout.contains(part), || run.stdout.clone())?;
    }
    let json = sandbox.json("b.json")?;
    ensure(
        json["command_line"][1] == "bench" && json["cores"].as_u64() > Some(0),
        || "no machine".into(),
    )?;
    let rows = json["rows"].as_array().ok_or("no rows")?;
    ensure(rows.len() == 2, || format!("{} rows", rows.len()))?;
    for row in rows {
        for name in [
            "backend",
            "adapter",
            "threads",
            "device_ms",
            "geometry_ms",
            "sah_ratio",
        ] {
            ensure(!row[name].is_null(), || format!("no {name}"))?;
        }
        ensure(row.get("driver").is_some(), || "no driver".into())?;
        let frames = row["per_frame"].as_array().ok_or("no frames")?;
        let times: Vec<_> = frames.iter().filter_map(|f| f["time"].as_f64()).collect();
        ensure(times == [1.0, 1.125, 1.25, 1.375, 1.5], || {
            format!("{times:?}")
        })?;
        let lacks = |f: &Value| FRAME.iter().any(|name| f.get(name).is_none());
        ensure(!frames.iter().any(lacks), || "a frame lacks a field".into())?;
        let mut device: Vec<_> = frames
            .iter()
            .filter_map(|f| f["device_ms"].as_f64())
            .collect();
        device.sort_by(f64::total_cmp);
        let median = row["device_ms"].as_f64().ok_or("no median")?;
        ensure((median - device[2]).abs() < 1e-5, || {
            format!("{median} of {device:?}")
        })?;
    }
    let wall = |run: usize| rows[run]["wall_ms"].as_f64().unwrap_or(f64::NAN);
    let ratio = json["ratios"][0]["wall"].as_f64().ok_or("no ratio")?;
    ensure((ratio - wall(0) / wall(1)).abs() < 1e-9, || {
        format!("{ratio} of {} and {}", wall(0), wall(1))
    })
}

fn random_rays(sandbox: &Sandbox) -> Result<(), Failed> {
    let words = "--frames 17 --update refit,auto --layout bvh2 --rays camera,random --json b.json";
    let run = sandbox.run(&format!("{SMALL} {words}")).succeeds()?;
    ensure(run.stdout.contains("bvh2, random rays"), || run.stdout)?;
    let json = sandbox.json("b.json")?;
    let rows = json["rows"].as_array().ok_or("no rows")?;
    let kinds: Vec<_> = rows.iter().map(|r| r["rays"].as_str()).collect();
    let random = Some("random");
    ensure(kinds == [None, None, random, random], || {
        format!("{kinds:?}")
    })?;
    for row in &rows[2..] {
        let hits = row["per_frame"][3]["hits"].as_u64();
        ensure(hits.is_some_and(|h| h > 0 && h < 16 * 12), || {
            format!("{hits:?} of 192 rays hit")
        })?;
        let only = row["trace_shadow_ms"].is_null() && row["mrays_per_s"].is_number();
        ensure(only, || "rays to the light were traced".into())?;
    }
    let ratios = json["ratios"].as_array().ok_or("no ratios")?;
    let is_random = |name: &Value| name.as_str().is_some_and(|n| n.contains("random"));
    let mixed = |r: &&Value| is_random(&r["run"]) != is_random(&r["over"]);
    ensure(
        ratios.len() == 4 && !ratios.iter().any(|r| mixed(&r)),
        || format!("{ratios:?}"),
    )
}

/// A run that is none of those measured, and an adapter that is not there.
fn refused(sandbox: &Sandbox) -> Result<(), Failed> {
    let other = sandbox.run(&format!("{SMALL} --frames 2 --against vulkan-rt"));
    other.fails(2, &["vulkan-rt", "cpu refit watertight fast"])?;
    let absent = sandbox.run(&format!("{SMALL} --adapter nothing-like-it"));
    absent.fails(2, &["nothing-like-it"])?;
    let missing = sandbox.run("bench --compare old.json new.json");
    missing.fails(2, &["old.json"])
}
