//! `render --timeline`: what host and device did when, side by side.
//!
//! Six tracks: what comes before the first frame, the frame loop, the device, vertices on their way to the
//! builder, the builder, and trees on their way to the device. One more for each
//! thread that writes files; beside them, how old and how good the tree was. The host's times are its own. Where the
//! device's lie among them, [`place_on_host`] says; within a submission its
//! stages follow each other without a gap.

use crate::session::Session;
use backend::StageTimes;
use output::{Timeline, Track, WriteError};
use pipeline::{Adopted, FrameRecord, Span, Submission, place_on_host};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

#[derive(Debug, Default)]
pub(crate) struct Notes {
    /// What came before the first frame, each with its end; the first entry is the beginning of the run.
    pub(crate) start_up: Vec<(&'static str, Instant)>,
    /// Frames, and how long each waited for those before it to be written.
    frames: Vec<(FrameRecord, [Instant; 2])>,
    /// Frames whose files were written, by which thread, and when.
    files: Vec<(u64, usize, [Instant; 2])>,
}

impl Notes {
    /// A frame is traced, and waited between these moments until it could be written.
    pub(crate) fn add(&mut self, record: &FrameRecord, waited: [Instant; 2]) {
        self.frames.push((record.clone(), waited));
    }

    /// The calling thread wrote a frame's files between these moments.
    pub(crate) fn wrote(&mut self, frame: u64, ends: [Instant; 2]) {
        let thread = rayon::current_thread_index().unwrap_or_default();
        self.files.push((frame, thread, ends));
    }

    pub(crate) fn write(&self, path: &Path, session: &Session) -> Result<(), WriteError> {
        let mut timeline = self.draw();
        let aligned = self.submissions().all(|(_, s)| s.times.begun_ms.is_some());
        let clock = if aligned {
            "aligned by when the host handed work in and saw its end"
        } else {
            "unknown: work ends when the host saw it"
        };
        timeline.fact("caption", json!(session.caption()));
        timeline.fact("device_clock", json!(clock));
        timeline.fact("command_line", json!(crate::record::command_line()));
        output::write_timeline(path, &timeline)
    }

    fn draw(&self) -> Timeline {
        let mut timeline = Timeline::new("abvh");
        let first = self.start_up.first().map(|(_, at)| *at);
        let first = first.or_else(|| Some(self.frames.first()?.0.moments.begun));
        let start_up = timeline.track("start-up");
        let mut chart = Chart {
            origin: first.unwrap_or_else(Instant::now),
            frames: timeline.track("frame loop"),
            device: timeline.track("device"),
            readback: timeline.track("read-back"),
            builder: timeline.track("builder"),
            upload: timeline.track("upload"),
            timeline,
        };
        for step in self.start_up.windows(2) {
            let ends = [step[0].1, step[1].1];
            chart.span(start_up, step[1].0, ends, &json!({}));
        }
        for (record, waited) in &self.frames {
            chart.host(record, *waited);
            if let Some(tree) = &record.adopted {
                chart.tree(record, tree);
            }
        }
        chart.files(&self.files);
        let (frames, submissions): (Vec<u64>, Vec<Submission>) = self.submissions().unzip();
        let spans = place_on_host(chart.origin, &submissions);
        for ((frame, submission), span) in frames.iter().zip(&submissions).zip(&spans) {
            chart.device(*frame, &submission.times, *span);
        }
        chart.timeline
    }

    /// All submissions in order, with the frame each belongs to.
    fn submissions(&self) -> impl Iterator<Item = (u64, Submission)> {
        self.frames.iter().flat_map(|(record, _)| {
            let both = record.fetched.into_iter().chain([record.traced]);
            both.map(|s| (record.frame.index, s))
        })
    }
}

struct Chart {
    /// The moment that counts as zero.
    origin: Instant,
    frames: Track,
    device: Track,
    readback: Track,
    builder: Track,
    upload: Track,
    timeline: Timeline,
}

impl Chart {
    /// Milliseconds after the origin, which nothing precedes.
    fn ms(&self, at: Instant) -> f64 {
        (at - self.origin).as_secs_f64() * 1e3
    }

    fn span(&mut self, track: Track, name: &'static str, ends: [Instant; 2], args: &Value) {
        let ends = ends.map(|at| self.ms(at));
        if ends[0] < ends[1] {
            self.timeline.span(track, name, ends, args.clone());
        }
    }

    /// What the frame loop did for a frame.
    fn host(&mut self, record: &FrameRecord, waited: [Instant; 2]) {
        let (track, m) = (self.frames, record.moments);
        let frame = json!({ "frame": record.frame.index });
        let begin = json!({
            "frame": record.frame.index,
            "time": record.frame.time,
            "tree_generation": record.tree_generation.0,
            "build_wait_ms": record.build_wait_ms,
        });
        self.span(track, "begin", [m.begun, m.submitted], &begin);
        self.span(track, "wait", [m.waited, m.seen], &frame);
        self.span(track, "read hits", [m.seen, m.read], &frame);
        self.span(track, "wait for files", waited, &frame);
        let begun = self.ms(m.begun);
        if let Some(generation) = record.asked {
            let args = json!({ "frame": record.frame.index, "generation": generation.0 });
            self.timeline.mark(track, "ask", begun, args);
        }
        let age = record.tree_age_frames as f64;
        self.timeline.counter("tree age", begun, age);
        if let Some(ratio) = record.sah_ratio {
            self.timeline.counter("SAH ratio", begun, ratio);
        }
    }

    fn files(&mut self, files: &[(u64, usize, [Instant; 2])]) {
        let threads: BTreeSet<usize> = files.iter().map(|f| f.1).collect();
        for (i, thread) in threads.into_iter().enumerate() {
            let track = self.timeline.track(&format!("files {}", i + 1));
            for (frame, _, ends) in files.iter().filter(|f| f.1 == thread) {
                self.span(track, "write files", *ends, &json!({ "frame": frame }));
            }
        }
    }

    /// The way of the tree that a frame swapped to.
    fn tree(&mut self, record: &FrameRecord, tree: &Adopted) {
        let generation = record.tree_generation.0;
        let (m, build) = (tree.moments, tree.moments.build);
        let built = json!({ "generation": generation, "triangles": tree.triangles });
        let moved = |bytes: u64| json!({ "generation": generation, "bytes": bytes });
        let builder = self.builder;
        if tree.snapshot_bytes > 0 {
            let vertices = moved(tree.snapshot_bytes);
            let way = [m.asked, m.arrived];
            self.span(self.readback, "vertices", way, &vertices);
        }
        self.span(builder, "build", [build.begun, build.built], &built);
        self.span(builder, "cost", [build.built, build.weighed], &built);
        self.span(builder, "convert", [build.weighed, build.ended], &built);
        self.span(
            self.upload,
            "tree",
            [m.taken, m.adopted],
            &moved(tree.upload_bytes),
        );
        let args = json!({
            "frame": record.frame.index,
            "generation": generation,
            "age_frames": record.tree_age_frames,
        });
        let adopted = self.ms(m.adopted);
        self.timeline.mark(self.frames, "adopt", adopted, args);
    }

    /// The stages of a submission, one after the other.
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
            if begin < end {
                let args = json!({ "frame": frame });
                self.timeline.span(self.device, name, [begin, end], args);
                begin = end;
            }
        }
    }
}
