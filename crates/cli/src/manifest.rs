//! What a run into a folder is: `abvh-run.json`, which says whether another run may go on with it.

use crate::args::{RenderArgs, has_own_trees, word};
use crate::frames;
use crate::stop::Stop;
use crate::values::{Frames, TimeRange};
use output::{Digest, digest_of};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) const FILE: &str = "abvh-run.json";
const SCHEMA: u32 = 1;

/// All that decides a byte of a run's pictures and hits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    schema: u32,
    version: String,
    /// What is rendered: the name of a demo or of inputs that are joined, and the files that are read.
    scene: SceneId,
    /// Whole times of the motion; not known of a shard without frames, which loads nothing.
    pub(crate) key_times: Option<usize>,
    options: BTreeMap<String, Value>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SceneId {
    name: Option<String>,
    files: Vec<(String, Digest)>,
}

impl Manifest {
    /// Of a run of these options over a motion with so many whole times.
    ///
    /// # Errors
    /// A file of the scene cannot be read.
    pub(crate) fn of(args: &RenderArgs, key_times: Option<usize>) -> Result<Self, Stop> {
        Ok(Self {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: SceneId::of(&args.scene)?,
            key_times,
            options: options(args, key_times),
        })
    }

    /// The one that a folder holds, if any.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) fn in_folder(folder: &Path) -> Result<Option<Self>, Stop> {
        let file = folder.join(FILE);
        let text = match host::read(&file) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Stop::bad(format!("cannot read {}: {e}", file.display()))),
        };
        let read = serde_json::from_slice(&text);
        read.map(Some).map_err(|e| {
            Stop::bad(format!(
                "{} is no manifest of a run: {e}; --overwrite starts afresh",
                file.display()
            ))
        })
    }

    /// The first thing in which two runs differ, as far as it is known of both.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        let has_end = self.key_times.is_some() && other.key_times.is_some();
        let texts = |m: &Self| -> BTreeMap<(u8, usize, String), Value> {
            let mut m = m.clone();
            if !has_end {
                m.forget_end();
            }
            let fixed = [
                ("schema", json!(m.schema)),
                ("program's version", json!(m.version)),
                ("scene", json!(m.scene.name)),
                ("number of key times", json!(m.key_times)),
            ];
            let fixed = (0..)
                .zip(fixed)
                .map(|(i, (name, v))| ((0, i, name.to_owned()), v));
            // Several may have one name, in folders of their own.
            let files = (0..).zip(m.scene.files);
            let files = files.map(|(i, (name, v))| ((1, i, format!("file {name}")), json!(v)));
            let options = m.options.into_iter();
            let options = options.map(|(name, v)| ((2, 0, format!("--{name}")), v));
            fixed.chain(files).chain(options).collect()
        };
        let (mine, theirs) = (texts(self), texts(other));
        let mut names = mine.keys().chain(theirs.keys());
        let differing = names.find(|name| mine.get(name) != theirs.get(name))?;
        let [a, b] = [&mine, &theirs].map(|all| {
            let found = all.get(differing);
            found.map_or_else(|| "absent".to_owned(), Value::to_string)
        });
        Some(format!("its {} is {a}, here it is {b}", differing.2))
    }

    /// Leaves out what only a loaded scene tells.
    fn forget_end(&mut self) {
        self.key_times = None;
        if let Some(Value::Object(frames)) = self.options.get_mut("frames") {
            frames.remove("to");
        }
    }
}

impl SceneId {
    fn of(spec: &str) -> Result<Self, Stop> {
        let files = scene::files(spec)?;
        let read = |file: &PathBuf| {
            let name = file.file_name().unwrap_or_default();
            let cannot = |e| Stop::bad(format!("cannot read {}: {e}", file.display()));
            let digest = digest_of(file).map_err(cannot)?;
            Ok((name.to_string_lossy().into_owned(), digest))
        };
        // Where a file lies decides nothing, but how inputs are placed does.
        let is_placed = spec.contains(['+', '@']);
        Ok(Self {
            name: (files.is_empty() || is_placed).then(|| spec.to_owned()),
            files: files.par_iter().map(read).collect::<Result<_, Stop>>()?,
        })
    }
}

fn options(args: &RenderArgs, key_times: Option<usize>) -> BTreeMap<String, Value> {
    let intersector = word(&args.method.intersector);
    // The answers of these are the same whoever gives them and however trees follow.
    let is_robust = matches!(&*intersector, "watertight" | "exact");
    let mut all = BTreeMap::from([
        ("size", json!(args.size.size)),
        ("eye", json!(args.camera.eye)),
        ("look-at", json!(args.camera.look_at)),
        ("up", json!(args.camera.up)),
        ("fov", json!(args.camera.fov)),
        ("light", json!(args.camera.light)),
        ("fps", json!(args.source.fps)),
        ("clip", json!(args.source.clip)),
        // How the default view frames the scene follows from it.
        ("key-memory", json!(args.source.key_memory)),
        ("frames", frames_value(args, key_times)),
        ("intersector", json!(intersector)),
    ]);
    if !is_robust || has_own_trees(args.device.backend) {
        all.insert("backend", json!(word(&args.device.backend)));
        all.insert("adapter", json!(args.device.adapter));
        all.insert("tolerance", json!(format!("{:?}", args.tolerance)));
    }
    let owned = |(name, value): (&str, Value)| (name.to_owned(), value);
    all.into_iter().map(owned).collect()
}

/// Frames at key times are what they are whichever others are asked for; of others, their number decides their times.
fn frames_value(args: &RenderArgs, key_times: Option<usize>) -> Value {
    let last = key_times.map_or(f64::INFINITY, |n| (n - 1) as f64);
    let range = args.time_range.unwrap_or(TimeRange {
        from: 0.0,
        to: last,
    });
    let count = match &args.frames {
        Some(Frames::Keys(_)) => return json!("key times"),
        Some(Frames::Count(n)) => *n,
        None => frames::default_count(range, frames::is_demo(&args.scene)),
    };
    json!({ "count": count, "from": range.from, "to": range.to })
}
