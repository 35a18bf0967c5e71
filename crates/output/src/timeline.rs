//! Timeline of host and device activity, in a format that browsers can display.
//!
//! The file is the object form of the *Trace Event Format* (Google, 2016), which Perfetto and Chrome's viewer open. Its
//! `traceEvents` has one event per line, with times in microseconds. The format calls a track a thread. Begin and end
//! times are rounded to whole nanoseconds in the same way, so adjacent spans remain adjacent.
//!
//! There are six fixed tracks: start-up, frame loop, device, read-back of vertices for the builder, builder, and upload
//! of trees. Each thread that writes files adds a track. Counters show the tree's age and quality.
//!
//! Host times are measured directly. [`place_on_host`] maps device times to the host's clock. The stages of a
//! submission follow each other without gaps.

use crate::{OutputError, write_with};
use backend::StageTimes;
use pipeline::{Adopted, FrameRecord, Span, TimedSubmission, place_on_host};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{self, Write};
use std::path::Path;
use std::time::Instant;

/// Recorded activity of a run.
#[derive(Debug, Default)]
pub struct RunTimeline {
    /// Steps of the start-up with their end times. The first entry is the beginning of the run.
    pub start_up: Vec<(&'static str, Instant)>,
    frames: Vec<TracedFrame>,
    files: Vec<WrittenFrame>,
}

#[derive(Debug)]
struct TracedFrame {
    record: FrameRecord,
    /// Interval in which it waited for earlier frames to be written.
    waited: [Instant; 2],
}

/// A frame whose files were written.
#[derive(Debug)]
struct WrittenFrame {
    frame: u64,
    /// Index of the writing thread.
    thread: usize,
    ends: [Instant; 2],
}

impl RunTimeline {
    /// Adds a traced frame. `waited` is the interval in which it waited to be written.
    pub fn add(&mut self, record: &FrameRecord, waited: [Instant; 2]) {
        let record = record.clone();
        self.frames.push(TracedFrame { record, waited });
    }

    /// Records that the calling thread wrote the files of `frame` during the interval `ends`.
    pub fn wrote(&mut self, frame: u64, ends: [Instant; 2]) {
        let thread = rayon::current_thread_index().unwrap_or_default();
        self.files.push(WrittenFrame {
            frame,
            thread,
            ends,
        });
    }

    /// Writes the timeline with `remarks` as its metadata.
    pub fn write(&self, path: &Path, mut remarks: Value) -> Result<(), OutputError> {
        let aligned = self.submissions().all(|(_, s)| s.times.begun_ms.is_some());
        remarks["device_clock"] = json!(if aligned {
            "aligned by when the host handed work in and saw its end"
        } else {
            "unknown: work ends when the host saw it"
        });
        let events = self.events();
        write_with(path, |out| write(out, &remarks, &events))
    }

    fn events(&self) -> Vec<Value> {
        let first = self.start_up.first().map(|(_, at)| *at);
        let first = first.or_else(|| Some(self.frames.first()?.record.moments.begun));
        let mut trace = TraceEvents {
            origin: first.unwrap_or_else(Instant::now),
            events: Vec::new(),
        };
        let whole = json!({ "args": { "name": "abvh" } });
        trace.event("M", 0, "process_name", whole);
        for (track, name) in (1..).zip(TRACKS) {
            trace.name(track, name);
        }
        for step in self.start_up.windows(2) {
            trace.span(START_UP, step[1].0, [step[0].1, step[1].1], &json!({}));
        }
        for TracedFrame { record, waited } in &self.frames {
            trace.host(record, *waited);
            if let Some(tree) = &record.adopted {
                trace.tree(record, tree);
            }
        }
        trace.files(&self.files);
        let (frames, submissions): (Vec<u64>, Vec<TimedSubmission>) = self.submissions().unzip();
        let spans = place_on_host(trace.origin, &submissions);
        for ((frame, submission), span) in frames.iter().zip(&submissions).zip(&spans) {
            trace.device(*frame, &submission.times, *span);
        }
        trace.events
    }

    /// Returns all submissions in order, each with the index of its frame.
    fn submissions(&self) -> impl Iterator<Item = (u64, TimedSubmission)> {
        self.frames.iter().flat_map(|TracedFrame { record, .. }| {
            let both = record.fetched.into_iter().chain([record.traced]);
            both.map(|s| (record.frame.index, s))
        })
    }
}

/// Writes the file with one event per line.
fn write(out: &mut dyn Write, remarks: &Value, events: &[Value]) -> io::Result<()> {
    let head = r#"{"displayTimeUnit":"ms","otherData":"#;
    write!(out, "{head}{remarks},\"traceEvents\":[")?;
    for (i, event) in events.iter().enumerate() {
        let between = if i == 0 { "\n" } else { ",\n" };
        write!(out, "{between}{event}")?;
    }
    out.write_all(b"\n]}\n")
}

/// Names of the fixed tracks, numbered from 1. The tracks of threads that write files follow.
const TRACKS: [&str; 6] = [
    "start-up",
    "frame loop",
    "device",
    "read-back",
    "builder",
    "upload",
];
const START_UP: usize = 1;
const FRAMES: usize = 2;
const DEVICE: usize = 3;
const READBACK: usize = 4;
const BUILDER: usize = 5;
const UPLOAD: usize = 6;

/// Converts milliseconds to microseconds, rounded to whole nanoseconds.
fn micros(ms: f64) -> f64 {
    (ms * 1e6).round() * 1e-3
}

struct TraceEvents {
    /// Time that is shown as zero.
    origin: Instant,
    /// Events in the fields of the Trace Event Format.
    events: Vec<Value>,
}

impl TraceEvents {
    /// Returns milliseconds since the origin, which is the earliest time.
    fn ms(&self, at: Instant) -> f64 {
        (at - self.origin).as_secs_f64() * 1e3
    }

    fn event(&mut self, kind: &str, track: usize, name: &str, mut fields: Value) {
        fields["ph"] = json!(kind);
        fields["name"] = json!(name);
        fields["pid"] = json!(1);
        fields["tid"] = json!(track);
        self.events.push(fields);
    }

    /// Sets the name and the position of a track.
    fn name(&mut self, track: usize, name: &str) {
        let name = json!({ "args": { "name": name } });
        self.event("M", track, "thread_name", name);
        let place = json!({ "args": { "sort_index": track } });
        self.event("M", track, "thread_sort_index", place);
    }

    /// Adds a span between two times.
    fn span(&mut self, track: usize, name: &str, ends: [Instant; 2], args: &Value) {
        self.span_ms(track, name, ends.map(|at| self.ms(at)), args);
    }

    fn span_ms(&mut self, track: usize, name: &str, [begin, end]: [f64; 2], args: &Value) {
        if begin < end {
            let (begin, end) = (micros(begin), micros(end));
            let span = json!({ "ts": begin, "dur": end - begin, "args": args });
            self.event("X", track, name, span);
        }
    }

    /// Adds an instant event to the track of the frame loop.
    fn mark(&mut self, name: &str, at: Instant, args: &Value) {
        let ts = micros(self.ms(at));
        let mark = json!({ "ts": ts, "s": "t", "args": args });
        self.event("i", FRAMES, name, mark);
    }

    /// Sets a counter to `value` from a given time on. Each counter is drawn as a curve.
    fn counter(&mut self, name: &str, at: Instant, value: f64) {
        let ts = micros(self.ms(at));
        let counter = json!({ "ts": ts, "args": { "value": value } });
        self.event("C", 0, name, counter);
    }

    /// Adds the activity of the frame loop for a frame.
    fn host(&mut self, record: &FrameRecord, waited: [Instant; 2]) {
        let m = record.moments;
        let frame = json!({ "frame": record.frame.index });
        let begin = json!({
            "frame": record.frame.index,
            "time": record.frame.time,
            "tree_generation": record.tree.generation.0,
            "build_wait_ms": record.build_wait_ms,
        });
        self.span(FRAMES, "begin", [m.begun, m.submitted], &begin);
        self.span(FRAMES, "wait", [m.waited, m.seen], &frame);
        self.span(FRAMES, "read hits", [m.seen, m.read], &frame);
        self.span(FRAMES, "wait for files", waited, &frame);
        if let Some(generation) = record.requested {
            let args = json!({ "frame": record.frame.index, "generation": generation.0 });
            self.mark("ask", m.begun, &args);
        }
        self.counter("tree age", m.begun, record.tree.age_frames as f64);
        if let Some(ratio) = record.tree.sah_ratio {
            self.counter("SAH ratio", m.begun, ratio);
        }
    }

    fn files(&mut self, files: &[WrittenFrame]) {
        let threads: BTreeSet<usize> = files.iter().map(|f| f.thread).collect();
        for (i, thread) in threads.into_iter().enumerate() {
            let track = TRACKS.len() + 1 + i;
            self.name(track, &format!("files {}", i + 1));
            for file in files.iter().filter(|f| f.thread == thread) {
                self.span(
                    track,
                    "write files",
                    file.ends,
                    &json!({ "frame": file.frame }),
                );
            }
        }
    }

    /// Adds the read-back, build and upload of the tree that a frame adopted.
    fn tree(&mut self, record: &FrameRecord, tree: &Adopted) {
        let generation = record.tree.generation.0;
        let (m, build) = (tree.moments, tree.moments.build);
        let built = json!({ "generation": generation, "triangles": tree.triangles });
        let moved = |bytes: u64| json!({ "generation": generation, "bytes": bytes });
        if tree.snapshot_bytes > 0 {
            let vertices = moved(tree.snapshot_bytes);
            self.span(READBACK, "vertices", [m.requested, m.arrived], &vertices);
        }
        self.span(BUILDER, "build", [build.begun, build.built], &built);
        self.span(BUILDER, "cost", [build.built, build.weighed], &built);
        self.span(BUILDER, "convert", [build.weighed, build.ended], &built);
        let sent = moved(record.tree.upload_bytes);
        self.span(UPLOAD, "tree", [m.taken, m.adopted], &sent);
        let args = json!({
            "frame": record.frame.index,
            "generation": generation,
            "age_frames": record.tree.age_frames,
        });
        self.mark("adopt", m.adopted, &args);
    }

    /// Adds the stages of a submission, one after the other.
    fn device(&mut self, frame: u64, times: &StageTimes, span: Span) {
        let mut begin = span.begin_ms;
        for (name, ms) in [
            ("interpolate", times.interpolate_ms),
            ("rebuild", times.rebuild_ms),
            ("preprocess", times.preprocess_ms),
            ("refit", times.refit_ms),
            ("trace primary", times.trace_primary_ms),
            ("trace shadow", times.trace_shadow_ms),
        ] {
            let end = (begin + ms.unwrap_or(0.0)).min(span.end_ms);
            self.span_ms(DEVICE, name, [begin, end], &json!({ "frame": frame }));
            begin = begin.max(end);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn adjacent_spans_remain_adjacent() {
        let begun = Instant::now();
        let third = Duration::from_secs(1) / 3;
        let steps = (0..50).map(|i| ("step", begun + third * i));
        let run = RunTimeline {
            start_up: steps.collect(),
            ..RunTimeline::default()
        };
        let mut bytes = Vec::new();
        write(&mut bytes, &json!({ "caption": "cpu" }), &run.events()).unwrap();
        let json: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(json["otherData"]["caption"], "cpu");
        let events = json["traceEvents"].as_array().unwrap();
        assert_eq!(events[0]["args"]["name"], "abvh");
        let spans: Vec<_> = events.iter().filter(|e| e["ph"] == "X").collect();
        assert_eq!((spans.len(), &spans[0]["tid"]), (49, &json!(START_UP)));
        for pair in spans.windows(2) {
            let end = pair[0]["ts"].as_f64().unwrap() + pair[0]["dur"].as_f64().unwrap();
            assert!((end - pair[1]["ts"].as_f64().unwrap()).abs() < 1e-6);
        }
    }
}
