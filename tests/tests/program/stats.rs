//! The statistics file: schema 1. The timeline: a trace that viewers open and that agrees with the statistics.

use crate::sandbox::{SQUARE, Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::{Value, json};
use std::collections::BTreeMap;

pub(crate) fn trials() -> Vec<Trial> {
    let agree = |(policy, read_back): (&'static str, usize)| {
        let name = format!("timeline::it_agrees_with_the_statistics::{policy}");
        trial(&name, move |sandbox| agrees(sandbox, policy, read_back))
    };
    let stats = [
        trial("stats::every_promised_field_is_there", every_field),
        trial("stats::what_cannot_be_hit_is_counted", unhittable),
        trial("stats::memory_is_counted_and_does_not_grow", memory),
    ];
    stats.into_iter().chain(POLICIES.map(agree)).collect()
}

const TOP: &str = "schema version command_line scene backend adapter driver threads summary";

pub(crate) const FRAME: &str = "frame time interpolate_ms preprocess_ms rebuild_ms refit_ms trace_primary_ms \
    trace_shadow_ms device_ms wall_ms build_wait_ms tree_generation tree_age_frames adopted rejected build_ms \
    convert_ms upload_bytes readback_bytes sah_ratio sah_cost hits blocked inactive degenerate settled host_bytes \
    device_bytes";

/// Those that every run measures: `rebuild_ms` is of trees made on a device alone, `trace_shadow_ms` of shadows that
/// are a stage of their own.
const TIMES: &str = "interpolate_ms preprocess_ms refit_ms trace_primary_ms device_ms wall_ms build_wait_ms build_ms \
    convert_ms";

/// Every one of these names is there, if only as null.
pub(crate) fn has_all(json: &Value, names: &str) {
    for name in names.split(' ') {
        assert!(json.get(name).is_some(), "no {name} in {json}");
    }
}

fn stats(sandbox: &Sandbox, options: &str) -> Value {
    let words = "render demo:collide:2000 --backend cpu --size 24x16 --no-images --quiet";
    sandbox.tells(&format!("{words} {options}"), "--stats").1
}

/// One number of each frame.
fn column(stats: &Value, name: &str) -> Vec<Option<f64>> {
    let frames = list(&stats["frames"]).iter();
    frames.map(|f| f[name].as_f64()).collect()
}

fn every_field(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 4 --update async --lockstep 1");
    has_all(&stats, TOP);
    has_all(&stats["summary"], TIMES);
    for frame in list(&stats["frames"]) {
        has_all(frame, FRAME);
    }
    for time in TIMES.split(' ') {
        has_all(&stats["summary"][time], "median p95 worst");
    }
    assert!(stats["schema"] == 1 && stats["backend"] == "cpu", "{stats}");
}

/// Triangles of vertices that are nowhere are counted, and the rest is seen.
fn unhittable(sandbox: &Sandbox) {
    let fourths = ["nan 1 0", "0 inf 0", "0 1 1e39", "0.5 0.5 0"];
    for (i, fourth) in fourths.into_iter().enumerate() {
        sandbox.write(&format!("{i}.obj"), SQUARE.replace("0 1 0", fourth));
    }
    sandbox.write("gone.obj", "v nan 0 0\nv nan 1 0\nv nan 1 1\nf 1 2 3\n");
    for (scene, inactive, degenerate, seen) in [
        ("0.obj+1.obj@2,0,0+2.obj@2,2,0", 3, 0, true),
        ("3.obj", 0, 1, true),
        ("gone.obj", 1, 0, false),
    ] {
        let words = format!("render {scene} --size 32x24 --quiet --out {inactive}{degenerate}");
        let frame = &sandbox.tells(&words, "--stats").1["frames"][0];
        let counted = frame["inactive"] == inactive && frame["degenerate"] == degenerate;
        let is_seen = frame["hits"].as_u64() > Some(0);
        assert!(counted && is_seen == seen, "{scene}: {frame}");
    }
}

/// Frames after the first hundreds take no more memory than those before them.
#[cfg(target_os = "linux")]
fn memory(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 1200 --update async");
    let bytes = column(&stats, "host_bytes");
    let known: Vec<f64> = bytes.iter().copied().flatten().collect();
    assert!(known.len() == 1200, "frames without a count");
    let course = &stats["summary"]["host_bytes"];
    let peak = known.iter().copied().fold(0.0, f64::max);
    assert!(course["worst"].as_f64() == Some(peak), "{course}");
    let most = |frames: &[f64]| frames.iter().copied().fold(0.0, f64::max);
    let growth = most(&known[900..]) - most(&known[300..600]);
    // The rows themselves take 0.4 kB a frame.
    assert!(growth < 2e6, "{growth} bytes in 600 frames");
}

/// Elsewhere nobody counts.
#[cfg(not(target_os = "linux"))]
fn memory(sandbox: &Sandbox) {
    let stats = stats(sandbox, "--frames 3 --update async");
    assert!(stats["summary"]["host_bytes"].is_null(), "{stats}");
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

const TRACKS: &str = "start-up|frame loop|device|read-back|builder|upload";

/// Microseconds that rounding may take: begin and end are whole nanoseconds.
const ROUNDING: f64 = 2e-3;

struct Event {
    name: String,
    begin: f64,
    end: f64,
    args: Value,
}

/// Events as a viewer reads them: spans by the names of their tracks, marks as `i`, counters as `C`.
struct Timeline(BTreeMap<String, Vec<Event>>);

impl Timeline {
    fn read(json: &Value) -> Self {
        let events = list(&json["traceEvents"]);
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let names = events.iter().filter(|e| e["name"] == "thread_name");
        let names: BTreeMap<_, _> = names
            .map(|e| (e["tid"].as_u64(), text(&e["args"]["name"])))
            .collect();
        let mut tracks = BTreeMap::<String, Vec<Event>>::new();
        for event in events.iter().filter(|e| e["ph"] != "M") {
            let track = match &*text(&event["ph"]) {
                "X" => names[&event["tid"].as_u64()].clone(),
                other => other.to_owned(),
            };
            let begin = event["ts"].as_f64().unwrap();
            tracks.entry(track).or_default().push(Event {
                name: text(&event["name"]),
                begin,
                end: begin + event["dur"].as_f64().unwrap_or(0.0),
                args: event["args"].clone(),
            });
        }
        let is_track = |name: &String| names.values().any(|n| n == name);
        let kinds: Vec<_> = tracks.keys().filter(|k| !is_track(k)).collect();
        assert_eq!(kinds, ["C", "i"]);
        assert!(TRACKS.split('|').all(|t| is_track(&t.to_owned())));
        Self(tracks)
    }

    fn events<'a>(&'a self, track: &str, name: &'a str) -> impl Iterator<Item = &'a Event> {
        let all = self.0.get(track).map_or(&[][..], Vec::as_slice).iter();
        all.filter(move |s| s.name == name)
    }

    /// Each track has its spans side by side.
    fn check_tracks(&mut self) {
        for track in TRACKS.split('|') {
            let spans = self.0.entry(track.to_owned()).or_default();
            spans.sort_by(|a, b| a.begin.total_cmp(&b.begin));
            for pair in spans.windows(2) {
                let (a, b) = (&pair[0], &pair[1]);
                let apart = a.end <= b.begin + ROUNDING;
                assert!(apart, "{track}: {} ends in {} {}", a.args, b.name, b.args);
            }
        }
    }
}

fn agrees(sandbox: &Sandbox, policy: &str, read_back: usize) {
    let words = "render demo:collide:2000 --frames 12 --size 24x16 --out out --quiet";
    let files = "--stats s.json --timeline t.json";
    sandbox.does(&format!("{words} --update {policy} {files}"));
    let mut timeline = Timeline::read(&sandbox.json("t.json"));
    timeline.check_tracks();
    let frames = list(&sandbox.json("s.json")["frames"]).to_vec();
    let rows = frames.iter().filter(|f| f["adopted"] == true);
    let adoption = |f: &Value| {
        let (frame, age) = (&f["frame"], &f["tree_age_frames"]);
        json!({ "frame": frame, "generation": f["tree_generation"], "age_frames": age })
    };
    let wanted: Vec<Value> = rows.map(adoption).collect();
    let mut read = timeline.events("start-up", "read the scene");
    let read = read.next().unwrap();
    let first = timeline.events("frame loop", "begin").next().unwrap();
    assert!(read.begin < read.end && read.end <= first.begin + ROUNDING);
    let marked: Vec<_> = timeline.events("i", "adopt").map(|m| &m.args).collect();
    assert_eq!(marked, wanted.iter().collect::<Vec<_>>());
    asked_before_adopted(&timeline);
    let ages = frames.iter().map(|f| f["tree_age_frames"].as_f64());
    let counted = timeline.events("C", "tree age");
    let counted = counted.map(|c| c.args["value"].as_f64());
    assert!(counted.eq(ages), "tree age");
    assert_eq!(timeline.events("C", "SAH ratio").count(), 12);
    let trees = wanted.len();
    for (track, name, wanted) in [
        ("builder", "build", trees),
        ("upload", "tree", trees),
        ("read-back", "vertices", trees.min(read_back)),
    ] {
        assert_eq!(timeline.events(track, name).count(), wanted, "{track}");
    }
    frames.iter().for_each(|f| device_times(&timeline, f));
}

/// Each tree adopted was asked for by the frame that its age names, and built in between.
fn asked_before_adopted(timeline: &Timeline) {
    for adopted in timeline.events("i", "adopt") {
        let generation = &adopted.args["generation"];
        let of = |span: &&Event| span.args["generation"] == *generation;
        let ask = timeline.events("i", "ask").find(of).unwrap();
        let frames = |mark: &Event, name: &str| mark.args[name].as_u64().unwrap();
        let age = frames(adopted, "frame") - frames(ask, "frame");
        assert_eq!(age, frames(adopted, "age_frames"), "{generation}");
        // Vertices need not come from the device: `agrees` counts those that do.
        let read = timeline.events("read-back", "vertices").find(of);
        let built = timeline.events("builder", "build").find(of).unwrap();
        let sent = timeline.events("upload", "tree").find(of).unwrap();
        let way = [Some(ask), read, Some(built), Some(sent), Some(adopted)];
        let way: Vec<_> = way.into_iter().flatten().collect();
        let in_turn = way.windows(2).all(|w| w[0].end <= w[1].begin + ROUNDING);
        assert!(in_turn, "{generation} comes too soon");
    }
}

/// Stages last as long as the statistics say, and lie where the host allows.
fn device_times(timeline: &Timeline, frame: &Value) {
    let of = |span: &&Event| span.args["frame"] == frame["frame"];
    for name in "interpolate|rebuild|preprocess|refit|trace primary|trace shadow".split('|') {
        let spans = timeline.events("device", name).filter(of);
        let drawn: f64 = spans.map(|s| s.end - s.begin).sum();
        let said = &frame[format!("{}_ms", name.replace(' ', "_"))];
        let same = (drawn - said.as_f64().unwrap_or(0.0) * 1e3).abs() < 0.01;
        assert!(same, "{frame}: {name} {drawn}, not {said}");
    }
    let begun = timeline.events("frame loop", "begin").find(of).unwrap();
    let first = timeline.0["device"].iter().filter(of).map(|s| s.begin);
    let first = first.fold(f64::INFINITY, f64::min);
    assert!(begun.begin <= first + ROUNDING, "{frame} ran too soon");
}
