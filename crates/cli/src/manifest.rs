//! What decides a byte of a run's pictures and hits.

use crate::args::{RenderArgs, has_own_trees, word};
use crate::frames;
use crate::stop::Stop;
use crate::values::{Frames, TimeRange};
use output::Manifest;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The manifest of a run over a motion with so many whole times.
///
/// # Errors
/// A file of the scene cannot be read.
pub(crate) fn manifest(args: &RenderArgs, key_times: usize) -> Result<Manifest, Stop> {
    let files = scene::files(&args.scene)?;
    // Where a file lies decides nothing, but how inputs are placed does.
    let is_placed = args.scene.contains(['+', '@']);
    let name = (files.is_empty() || is_placed).then_some(&*args.scene);
    let (version, options) = (env!("CARGO_PKG_VERSION"), options(args, key_times));
    Ok(Manifest::new(version, (name, &files), key_times, options)?)
}

fn options(args: &RenderArgs, key_times: usize) -> BTreeMap<String, Value> {
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
fn frames_value(args: &RenderArgs, key_times: usize) -> Value {
    let to = (key_times - 1) as f64;
    let range = args.time_range.unwrap_or(TimeRange { from: 0.0, to });
    let count = match &args.frames {
        Some(Frames::Keys(_)) => return json!("key times"),
        Some(Frames::Count(n)) => *n,
        None => frames::default_count(range, frames::is_demo(&args.scene)),
    };
    json!({ "count": count, "from": range.from, "to": range.to })
}
