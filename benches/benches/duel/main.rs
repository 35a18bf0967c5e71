//! Compares this program with Embree, sample by sample in alternation: builds, refits and rays.
//!
//! `cargo bench -p benches --bench duel [-- FILE.json [GROUP|SCENE]...]`. A group is `build`, `refit`, `primary`, `shadow`,
//! `diffuse` or another kind of rays. A scene is `demo:collide:70000` or a path.
//!
//! `ABVH_THREADS=1,2,16`, `ABVH_ROUNDS=9` and `ABVH_WIDTH=1920` (of an image) configure the measurement. Alternation
//! exposes both programs to the same changes of the machine's load. Ratios are medians over rounds, by wall time and by
//! processor time. The minimum times approximate an idle machine.

mod build;
mod trace;

use backend::Intersector;
use benches::{
    Contender, EmbreeScene, Mesh, SceneMode, in_turn, least, median, meshes, print_table, setting,
    thread_counts, words,
};
use serde_json::{Value, json};
use std::process::Command;

fn main() {
    let mut words = words();
    let file = words.next();
    let (scenes, only): (Vec<String>, Vec<String>) =
        words.partition(|word| word.contains([':', '/']));
    let mut groups = Vec::new();
    let before = load();
    let open = |spec: &String| Mesh::open(spec).expect("a scene");
    let meshes = match scenes.is_empty() {
        true => meshes(),
        false => scenes.iter().map(open).collect(),
    };
    for mesh in meshes.iter().map(Mesh::soup) {
        for threads in thread_counts() {
            if is_asked(&only, "build") {
                groups.push(build::times(&mesh, threads));
            }
            if is_asked(&only, "refit") {
                groups.push(build::refits(&mesh, threads));
            }
        }
        groups.extend(trace::all(&mesh, &|what| is_asked(&only, what)));
    }
    let report = json!({
        "machine": machine(),
        "commit": commit(),
        "load_before_and_after": [before, load()],
        "groups": groups,
    });
    if let Some(file) = file {
        let text = serde_json::to_string_pretty(&report).expect("numbers and names");
        std::fs::write(&file, text + "\n").unwrap_or_else(|why| panic!("{file}: {why}"));
    }
}

/// Builds Embree's scene of a mesh at its start. Panics if the library is absent.
fn embree(mesh: &Mesh, threads: usize, made: SceneMode) -> EmbreeScene {
    let (vertices, triangles) = (mesh.positions(mesh.start()), mesh.animation.triangles());
    EmbreeScene::new(&vertices, triangles, threads, made).expect("Embree is installed")
}

/// Returns the processor model and its number of hardware threads.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let model = line.and_then(|line| line.split(':').nth(1));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{}, {threads} threads", model.unwrap_or("unknown").trim())
}

/// Returns the commit that was built, marked if files were changed since.
fn commit() -> String {
    let git = Command::new("git")
        .args(["describe", "--always", "--dirty", "--exclude", "*"])
        .output();
    let text = git.map(|done| String::from_utf8_lossy(&done.stdout).trim().to_owned());
    text.unwrap_or_default()
}

/// Returns the load average of the last minute.
fn load() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().unwrap_or_default().to_owned()
}

/// Our intersector.
const INTERSECTOR: Intersector = Intersector::Watertight;

/// Default number of rounds per group.
const ROUNDS: usize = 15;

/// Returns whether a group was selected, or no selection was made.
fn is_asked(only: &[String], what: &str) -> bool {
    only.is_empty() || only.iter().any(|word| word == what)
}

/// Conversion of a time to a reported number.
#[derive(Clone, Copy)]
enum Unit {
    /// Nanoseconds per triangle, for this number of triangles.
    NsEach(usize),
    /// Millions of rays per second, for this number of rays.
    MillionsOf(usize),
}

impl Unit {
    fn of(self, ms: f64) -> f64 {
        match self {
            Self::NsEach(triangles) => ms * 1e6 / triangles as f64,
            Self::MillionsOf(rays) => rays as f64 / (ms * 1e3),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::NsEach(_) => "ns per triangle",
            Self::MillionsOf(_) => "million rays per second",
        }
    }
}

/// Measures one group, prints it and returns it as JSON. All contenders are compared with the first.
fn group(title: &str, unit: Unit, contenders: Vec<Contender<'_>>) -> Value {
    let samples = in_turn(contenders, setting("ABVH_ROUNDS", ROUNDS));
    let header = "|threads|best|median|by processor time|cores busy|wall time / baseline|processor time / baseline|hits";
    let (mut rows, mut contenders) = (Vec::new(), Vec::new());
    for one in &samples {
        let [wall, processor] = one.over(&samples[0]);
        let best = unit.of(least(&one.wall));
        let [middle, by_processor] = [&one.wall, &one.processor].map(|t| unit.of(median(t)));
        let mut row = vec![one.name.clone(), one.threads.to_string()];
        row.extend([best, middle, by_processor].map(|x| format!("{x:.1}")));
        row.push(format!("{:.1}", median(&one.processor) / median(&one.wall)));
        row.extend([wall, processor].map(|x| format!("{x:.3}")));
        row.push(one.hits.to_string());
        rows.push(row);
        contenders.push(json!({
            "name": one.name, "threads": one.threads, "best": best, "median": middle, "by_processor_time": by_processor,
            "wall_over_baseline": wall, "processor_over_baseline": processor,
            "wall_ms": one.wall, "processor_ms": one.processor, "hits": one.hits,
        }));
    }
    print_table(title, &(unit.name().to_owned() + header), rows);
    let (unit, baseline) = (unit.name(), &samples[0].name);
    json!({ "title": title, "unit": unit, "baseline": baseline, "contenders": contenders })
}
