//! `--timeline`: a trace that viewers open and that agrees with the statistics.

use crate::sandbox::{Sandbox, ensure, trial};
use libtest_mimic::{Failed, Trial};
use serde_json::Value;
use std::collections::BTreeMap;

pub(crate) fn trials() -> Vec<Trial> {
    let mut trials: Vec<Trial> = POLICIES
        .into_iter()
        .map(|(policy, read_back)| {
            let name = format!("timeline::it_agrees_with_the_statistics::{policy}");
            trial(&name, move |sandbox| agrees(sandbox, policy, read_back))
        })
        .collect();
    trials.push(trial(
        "timeline::builds_overlap_frames_that_wait_for_none",
        overlap,
    ));
    trials
}

/// Each with the number of trees whose vertices are read back, at most.
const POLICIES: [(&str, usize); 7] = [
    ("rebuild", usize::MAX),
    ("refit", 1),
    ("t-sah", 0),
    ("async", 1),
    ("async --predict off", usize::MAX),
    ("async --lockstep 2", 1),
    ("async --lockstep 2 --predict off", usize::MAX),
];

const TRACKS: [&str; 5] = ["frame loop", "device", "read-back", "builder", "upload"];

/// Microseconds that rounding may take: begin and end are whole nanoseconds.
const ROUNDING: f64 = 2e-3;

struct Span {
    name: String,
    begin: f64,
    end: f64,
    args: Value,
}

/// A timeline as a viewer reads it.
struct Timeline {
    tracks: BTreeMap<String, Vec<Span>>,
    marks: Vec<Span>,
    counters: Vec<(String, f64)>,
}

impl Timeline {
    fn read(sandbox: &Sandbox, file: &str) -> Result<Self, Failed> {
        let json: Value = serde_json::from_slice(&sandbox.read(file))?;
        let events = json["traceEvents"].as_array().ok_or("no events")?;
        let mut names = BTreeMap::new();
        for event in events.iter().filter(|e| e["name"] == "thread_name") {
            let name = event["args"]["name"]
                .as_str()
                .ok_or("a track has no name")?;
            names.insert(event["tid"].as_u64(), name.to_owned());
        }
        let mut timeline = Self {
            tracks: names.values().map(|n| (n.clone(), Vec::new())).collect(),
            marks: Vec::new(),
            counters: Vec::new(),
        };
        for event in events.iter().filter(|e| e["ph"] != "M") {
            let name = event["name"].as_str().ok_or("an event has no name")?;
            let begin = event["ts"].as_f64().ok_or("an event has no time")?;
            let span = Span {
                name: name.to_owned(),
                begin,
                end: begin + event["dur"].as_f64().unwrap_or(0.0),
                args: event["args"].clone(),
            };
            match event["ph"].as_str() {
                Some("X") => {
                    let track = names.get(&event["tid"].as_u64()).ok_or("no such track")?;
                    timeline.tracks.entry(track.clone()).or_default().push(span);
                }
                Some("i") => timeline.marks.push(span),
                Some("C") => {
                    let value = event["args"]["value"].as_f64().ok_or("no value")?;
                    timeline.counters.push((span.name, value));
                }
                other => return Err(format!("an event of kind {other:?}").into()),
            }
        }
        Ok(timeline)
    }

    fn spans<'a>(&'a self, track: &str, name: &'a str) -> impl Iterator<Item = &'a Span> {
        self.tracks[track].iter().filter(move |s| s.name == name)
    }

    fn marks(&self, name: &str) -> impl Iterator<Item = &Span> {
        self.marks.iter().filter(move |s| s.name == name)
    }

    /// Values of a counter, one a frame.
    fn counter(&self, name: &str) -> Vec<f64> {
        let named = self.counters.iter().filter(|c| c.0 == name);
        named.map(|c| c.1).collect()
    }

    /// Each track has its spans side by side.
    fn check_tracks(&self) -> Result<(), Failed> {
        for track in TRACKS {
            let spans = self.tracks.get(track).ok_or(format!("no track {track}"))?;
            let mut order: Vec<&Span> = spans.iter().collect();
            order.sort_by(|a, b| a.begin.total_cmp(&b.begin));
            for pair in order.windows(2) {
                let [a, b] = pair else { continue };
                ensure(a.end <= b.begin + ROUNDING, || {
                    let (a_name, b_name) = (&a.name, &b.name);
                    format!("{track}: {a_name} {} ends in {b_name} {}", a.args, b.args)
                })?;
            }
        }
        Ok(())
    }
}

fn render(sandbox: &Sandbox, words: &str) -> Result<(Timeline, Value), Failed> {
    let files = "--stats s.json --timeline t.json --quiet";
    sandbox.run(&format!("render {words} {files}")).succeeds()?;
    let stats = serde_json::from_slice(&sandbox.read("s.json"))?;
    Ok((Timeline::read(sandbox, "t.json")?, stats))
}

fn agrees(sandbox: &Sandbox, policy: &str, read_back: usize) -> Result<(), Failed> {
    let scene = "demo:collide:2000 --frames 12 --size 24x16 --out out";
    let (timeline, stats) = render(sandbox, &format!("{scene} --update {policy}"))?;
    timeline.check_tracks()?;
    let frames = stats["frames"].as_array().ok_or("no frames")?;
    let rows = frames.iter().filter(|f| f["adopted"] == true);
    let wanted: Vec<Value> = rows
        .map(|f| {
            serde_json::json!({
                "frame": f["frame"], "generation": f["tree_generation"], "age_frames": f["tree_age_frames"],
            })
        })
        .collect();
    let marked: Vec<Value> = timeline.marks("adopt").map(|m| m.args.clone()).collect();
    ensure(marked == wanted, || format!("{marked:?}, not {wanted:?}"))?;
    asked_before_adopted(&timeline)?;
    let ages: Vec<f64> = frames
        .iter()
        .filter_map(|f| f["tree_age_frames"].as_f64())
        .collect();
    ensure(timeline.counter("tree age") == ages, || "tree age".into())?;
    ensure(timeline.counter("SAH ratio").len() == 12, || "SAH".into())?;
    let trees = wanted.len();
    for (track, name, wanted) in [
        ("builder", "build", trees),
        ("upload", "tree", trees),
        ("read-back", "vertices", trees.min(read_back)),
    ] {
        let count = timeline.spans(track, name).count();
        ensure(count == wanted, || format!("{count} spans of {track}"))?;
    }
    device_times(&timeline, frames)
}

/// Each tree adopted was asked for by the frame that its age names, and built in between.
fn asked_before_adopted(timeline: &Timeline) -> Result<(), Failed> {
    for adopted in timeline.marks("adopt") {
        let generation = &adopted.args["generation"];
        let of = |span: &&Span| span.args["generation"] == *generation;
        let ask = timeline.marks("ask").find(of).ok_or("nobody asked")?;
        let frames = |mark: &Span, name: &str| mark.args[name].as_u64().unwrap_or(u64::MAX);
        let age = frames(adopted, "frame") - frames(ask, "frame");
        ensure(age == frames(adopted, "age_frames"), || {
            format!("{generation}")
        })?;
        let way = [
            ("read-back", "vertices"),
            ("builder", "build"),
            ("upload", "tree"),
        ]
        .map(|(track, name)| timeline.spans(track, name).find(of));
        let mut now = ask.begin;
        for (i, span) in way.into_iter().enumerate() {
            // Vertices need not come from the device: `agrees` counts those that do.
            if i == 0 && span.is_none() {
                continue;
            }
            let span = span.ok_or(format!("tree {generation} has a gap in its way"))?;
            ensure(now <= span.begin + ROUNDING, || {
                format!("{generation}: {}", span.name)
            })?;
            now = span.end;
        }
        ensure(now <= adopted.begin + ROUNDING, || {
            format!("{generation}: adopted too soon")
        })?;
    }
    Ok(())
}

/// Stages last as long as the statistics say, and lie where the host allows.
fn device_times(timeline: &Timeline, frames: &[Value]) -> Result<(), Failed> {
    let stages = [
        ("interpolate", "interpolate_ms"),
        ("rebuild", "rebuild_ms"),
        ("preprocess", "preprocess_ms"),
        ("refit", "refit_ms"),
        ("trace primary", "trace_primary_ms"),
        ("trace shadow", "trace_shadow_ms"),
    ];
    for frame in frames {
        let of = |span: &&Span| span.args["frame"] == frame["frame"];
        for (name, field) in stages {
            let drawn: f64 = timeline
                .spans("device", name)
                .filter(of)
                .map(|s| s.end - s.begin)
                .sum();
            let said = frame[field].as_f64().unwrap_or(0.0) * 1e3;
            ensure((drawn - said).abs() < 0.01, || {
                format!("frame {}: {name} {drawn}, not {said}", frame["frame"])
            })?;
        }
        let begun = timeline.spans("frame loop", "begin").find(of);
        let begun = begun.ok_or("a frame never began")?;
        let device = timeline.tracks["device"].iter().filter(of);
        let first = device.map(|s| s.begin).fold(f64::INFINITY, f64::min);
        ensure(begun.begin <= first + ROUNDING, || {
            format!("frame {} ran before it began", frame["frame"])
        })?;
    }
    Ok(())
}

/// Trees that take many frames to build are built beside frames that do not wait for them.
fn overlap(sandbox: &Sandbox) -> Result<(), Failed> {
    let scene = "demo:shatter:150000 --frames 200 --size 16x9 --no-images";
    let threads = "--update async --threads 1 --builder-threads 1";
    let (timeline, stats) = render(sandbox, &format!("{scene} {threads}"))?;
    timeline.check_tracks()?;
    let frames = stats["frames"].as_array().ok_or("no frames")?;
    for frame in &frames[1..] {
        ensure(frame["build_wait_ms"] == 0.0, || format!("waited: {frame}"))?;
    }
    let built = || timeline.spans("builder", "build").skip(1);
    ensure(built().count() > 0, || {
        "no tree was built beside frames".into()
    })?;
    for build in built() {
        let beside = timeline.tracks["device"]
            .iter()
            .filter(|s| s.begin < build.end && build.begin < s.end)
            .count();
        ensure(beside > 0, || format!("nothing ran beside {}", build.args))?;
    }
    Ok(())
}
