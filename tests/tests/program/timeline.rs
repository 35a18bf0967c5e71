//! `--timeline`: a trace that viewers open and that agrees with the statistics.

use crate::sandbox::{Sandbox, list, trial};
use libtest_mimic::Trial;
use serde_json::Value;
use std::collections::BTreeMap;

pub(crate) fn trials() -> Vec<Trial> {
    let agree = |(policy, read_back): (&str, usize)| {
        let name = format!("timeline::it_agrees_with_the_statistics::{policy}");
        let words =
            format!("demo:collide:2000 --frames 12 --size 24x16 --out out --update {policy}");
        trial(&name, move |sandbox| agrees(sandbox, &words, read_back))
    };
    POLICIES.map(agree).into()
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

const TRACKS: [&str; 6] = [
    "start-up",
    "frame loop",
    "device",
    "read-back",
    "builder",
    "upload",
];

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
        assert!(TRACKS.iter().all(|&t| is_track(&t.to_owned())));
        Self(tracks)
    }

    fn events<'a>(&'a self, track: &str, name: &'a str) -> impl Iterator<Item = &'a Event> {
        let all = self.0.get(track).map_or(&[][..], Vec::as_slice).iter();
        all.filter(move |s| s.name == name)
    }

    /// Each track has its spans side by side.
    fn check_tracks(&mut self) {
        for track in TRACKS {
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

fn agrees(sandbox: &Sandbox, words: &str, read_back: usize) {
    sandbox.does(&format!(
        "render {words} --stats s.json --timeline t.json --quiet"
    ));
    let mut timeline = Timeline::read(&sandbox.json("t.json"));
    timeline.check_tracks();
    let frames = list(&sandbox.json("s.json")["frames"]).to_vec();
    let rows = frames.iter().filter(|f| f["adopted"] == true);
    let wanted: Vec<Value> = rows
        .map(|f| {
            serde_json::json!({
                "frame": f["frame"], "generation": f["tree_generation"], "age_frames": f["tree_age_frames"],
            })
        })
        .collect();
    let read = timeline
        .events("start-up", "read the scene")
        .next()
        .unwrap();
    let first = timeline.events("frame loop", "begin").next().unwrap();
    assert!(read.begin < read.end && read.end <= first.begin + ROUNDING);
    let marked: Vec<_> = timeline.events("i", "adopt").map(|m| &m.args).collect();
    assert_eq!(marked, wanted.iter().collect::<Vec<_>>());
    asked_before_adopted(&timeline);
    let ages: Vec<_> = frames
        .iter()
        .map(|f| f["tree_age_frames"].as_f64())
        .collect();
    let counted = timeline
        .events("C", "tree age")
        .map(|c| c.args["value"].as_f64());
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
    for name in [
        "interpolate",
        "rebuild",
        "preprocess",
        "refit",
        "trace primary",
        "trace shadow",
    ] {
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
