//! What happened when, as a trace that browsers draw.
//!
//! The object form of the *Trace Event Format* (Google, 2016), which Perfetto
//! and Chrome's own viewer open: an object whose `traceEvents` holds one event
//! a line, times in microseconds. A track is what the format calls a thread.
//! Times are rounded to whole nanoseconds, begin and end alike, so that spans
//! that meet still meet.

use crate::WriteError;
use crate::atomic::write_with;
use serde_json::{Map, Value, json};
use std::io::{self, Write};
use std::path::Path;

/// Spans, marks and counters of one run, by track.
#[derive(Clone, Debug, Default)]
pub struct Timeline {
    tracks: u32,
    /// In the format's own fields and letters.
    events: Vec<Value>,
    facts: Map<String, Value>,
}

/// One row of the picture, made by [`Timeline::track`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Track(u32);

/// The one process there is.
const PROCESS: u32 = 1;

impl Timeline {
    /// An empty timeline of what is called `name`.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let mut timeline = Self::default();
        timeline.add("M", "process_name", Track(0), json!({ "name": name }), []);
        timeline
    }

    /// Adds a row below those there are.
    pub fn track(&mut self, name: &str) -> Track {
        self.tracks += 1;
        let track = Track(self.tracks);
        self.add("M", "thread_name", track, json!({ "name": name }), []);
        let index = json!({ "sort_index": track.0 });
        self.add("M", "thread_sort_index", track, index, []);
        track
    }

    /// Something that lasted from `begin_ms` to `end_ms`.
    pub fn span(
        &mut self,
        track: Track,
        name: &'static str,
        [begin_ms, end_ms]: [f64; 2],
        args: Value,
    ) {
        let [begin, end] = [begin_ms, end_ms].map(nanoseconds);
        let length = (end - begin).max(0.0) * 1e-3;
        let times = [("ts", json!(begin * 1e-3)), ("dur", json!(length))];
        self.add("X", name, track, args, times);
    }

    /// Something that happened at once.
    pub fn mark(&mut self, track: Track, name: &'static str, at_ms: f64, args: Value) {
        let at = json!(nanoseconds(at_ms) * 1e-3);
        self.add("i", name, track, args, [("ts", at), ("s", json!("t"))]);
    }

    /// A quantity that has `value` from `at_ms` on, drawn as a curve of its own.
    pub fn counter(&mut self, name: &'static str, at_ms: f64, value: f64) {
        let at = json!(nanoseconds(at_ms) * 1e-3);
        self.add("C", name, Track(0), json!({ "value": value }), [("ts", at)]);
    }

    /// A remark on the whole.
    pub fn fact(&mut self, name: &str, value: Value) {
        self.facts.insert(name.to_owned(), value);
    }

    fn add<const N: usize>(
        &mut self,
        ph: &str,
        name: &str,
        track: Track,
        args: Value,
        more: [(&str, Value); N],
    ) {
        let mut event = json!({ "ph": ph, "name": name, "pid": PROCESS, "tid": track.0 });
        let args = Some(("args", args)).filter(|a| !a.1.is_null());
        for (name, value) in more.into_iter().chain(args) {
            event[name] = value;
        }
        self.events.push(event);
    }
}

/// Writes a timeline, one event a line.
///
/// # Errors
/// [`WriteError`]; `path` then holds what it held before.
pub fn write_timeline(path: &Path, timeline: &Timeline) -> Result<(), WriteError> {
    write_with(path, |out| write(out, timeline))
}

fn write(out: &mut dyn Write, timeline: &Timeline) -> io::Result<()> {
    out.write_all(b"{\"displayTimeUnit\":\"ms\",\"otherData\":")?;
    serde_json::to_writer(&mut *out, &timeline.facts)?;
    out.write_all(b",\"traceEvents\":[")?;
    for (i, event) in timeline.events.iter().enumerate() {
        out.write_all(if i == 0 { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut *out, event)?;
    }
    out.write_all(b"\n]}\n")
}

/// Whole nanoseconds of so many milliseconds.
fn nanoseconds(ms: f64) -> f64 {
    (ms * 1e6).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(timeline: &Timeline) -> Value {
        let mut bytes = Vec::new();
        write(&mut bytes, timeline).unwrap();
        serde_json::from_slice(&bytes).unwrap()
    }

    #[test]
    fn events_are_what_viewers_expect() {
        assert_eq!(written(&Timeline::default())["traceEvents"], json!([]));
        let mut timeline = Timeline::new("abvh");
        timeline.fact("backend", json!("cpu"));
        let (host, device) = (timeline.track("frame loop"), timeline.track("device"));
        timeline.span(host, "begin", [1.5, 2.25], json!({ "frame": 3 }));
        timeline.mark(device, "ask", 1.75, Value::Null);
        timeline.counter("tree age", 2.0, 7.0);
        let json = written(&timeline);
        assert_eq!(json["otherData"]["backend"], "cpu");
        let events = json["traceEvents"].as_array().unwrap();
        assert_eq!(events[0]["args"]["name"], "abvh");
        let [span, mark, counter] = &events[5..] else {
            panic!("{events:?}");
        };
        let x = json!({"ph": "X", "name": "begin", "pid": 1, "tid": 1, "ts": 1500.0, "dur": 750.0, "args": {"frame": 3}});
        assert_eq!(*span, x);
        let i = json!({"ph": "i", "name": "ask", "pid": 1, "tid": 2, "ts": 1750.0, "s": "t"});
        assert_eq!(*mark, i);
        assert_eq!(counter["args"]["value"], 7.0);
    }

    #[test]
    fn spans_that_meet_still_meet() {
        let mut timeline = Timeline::default();
        let track = timeline.track("device");
        let third = 1e3 / 3.0;
        for i in 0..50 {
            let i = f64::from(i);
            timeline.span(track, "a", [third * i, third * (i + 1.0)], Value::Null);
        }
        let json = written(&timeline);
        let events = &json["traceEvents"].as_array().unwrap()[2..];
        for pair in events.windows(2) {
            let end = pair[0]["ts"].as_f64().unwrap() + pair[0]["dur"].as_f64().unwrap();
            assert!((end - pair[1]["ts"].as_f64().unwrap()).abs() < 1e-6);
        }
    }
}
