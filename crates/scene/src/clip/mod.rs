//! glTF: one clip of a file's animations, sampled to vertex key frames.
//!
//! After the glTF 2.0 specification (Khronos): node transforms, skins and morph targets are evaluated at each key in
//! double precision and rounded once. Textures, cameras and lights are not read.

mod accessor;
mod document;
mod motion;
mod part;
mod rig;

use crate::mesh::joined_triangles;
use crate::source::extension;
use crate::stream::{check_counts, check_keys, within};
use crate::{Facts, MAX_FPS, Options, Result, Scene, SceneError, stream};
use document::File;
use motion::Motion;
use part::Part;
use rig::Rig;
use std::path::Path;
use std::sync::Arc;

const MAX_KEYS: usize = 1 << 16;
/// The most vertices in all key frames together: 48 GiB.
const MAX_POSITIONS: usize = 1 << 32;

pub(crate) fn open(name: String, path: &Path, options: &Options) -> Result<Scene> {
    let fps = options.fps;
    if !(fps > 0.0 && fps <= MAX_FPS) {
        return Err(SceneError(format!(
            "bad frame rate {fps}: give frames a second above 0 and at most {MAX_FPS}"
        )));
    }
    let file = File::open(path, options.allow_outside)?;
    let rig = Rig::new(&file)?;
    let mut notes = file.remarks();
    part::check_room(&file, &rig, options)?;
    let parts = part::all(&file, &rig, &mut notes)?;
    let clip = choose(&file, options, &mut notes)?;
    let motion = Motion::of(&file, clip.as_ref())?;
    let times = times(path, motion.span(), fps)?;
    let vertices = parts.iter().map(Part::vertices).sum();
    check_sizes(path, &parts, (times.len(), vertices), &notes, options)?;
    let colours = |p: &Part| std::iter::repeat_n(p.colour, p.triangles.len());
    let colours = parts.iter().flat_map(colours).collect();
    let triangles = joined_triangles(parts.iter().map(|p| (&p.triangles[..], p.vertices())));
    let facts = Facts {
        format: extension(path),
        files: vec![path.to_owned()],
        clip: clip.as_ref().map(clip_name),
        seconds_per_key: (times.len() > 1).then(|| times[1] - times[0]),
        notes,
    };
    let keys = times.len();
    let source = move |key: usize| {
        let time = times[key];
        let pose = rig.pose(&motion, time);
        // A list that grows takes more than its points in the end.
        let mut points = Vec::with_capacity(vertices);
        for part in &parts {
            points.extend(part.positions(&pose, &motion, time));
        }
        Ok(points)
    };
    let animation = stream::animation(source, (keys, vertices), triangles, options)?;
    Ok(Scene {
        name,
        animation: Arc::new(animation),
        colours,
        facts,
    })
}

fn clip_name(clip: &gltf::Animation<'_>) -> String {
    clip.name()
        .map_or_else(|| clip.index().to_string(), str::to_owned)
}

/// The clip asked for, by name or else by index; the first if none is asked for.
fn choose<'a>(
    file: &'a File,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<Option<gltf::Animation<'a>>> {
    let mut clips = file.document.animations();
    let all: Vec<_> = clips.clone().map(|clip| clip_name(&clip)).collect();
    let Some(asked) = &options.clip else {
        if all.len() > 1 {
            let (count, names) = (all.len(), all.join(", "));
            notes.push(format!("took the first of {count} clips: {names}"));
        }
        return Ok(clips.next());
    };
    let named = all.iter().position(|name| name == asked);
    let index = named.or_else(|| asked.parse().ok());
    if let Some(clip) = index.and_then(|i| clips.nth(i)) {
        return Ok(Some(clip));
    }
    let numbered = |(i, name): (usize, &String)| format!("{i} {name:?}");
    let numbered: Vec<_> = all.iter().enumerate().map(numbered).collect();
    let there = match all.is_empty() {
        true => "the file has no clips".to_owned(),
        false => format!("there are {}", numbered.join(", ")),
    };
    let cause = format!("no clip {asked:?}; {there}");
    Err(SceneError::unusable(&file.path, cause))
}

/// Times in seconds from end to end of the clip, evenly spaced, `fps` a second or a little more.
fn times(path: &Path, [start, end]: [f64; 2], fps: f64) -> Result<Vec<f64>> {
    // The allowance keeps rounding from adding a key: 2.0000001 s are two.
    let steps = ((end - start) * fps - 1e-4).ceil().max(0.0) as usize;
    within(path, "key frames", steps.saturating_add(1), MAX_KEYS)?;
    let at = |i: usize| match i == steps {
        true => end,
        false => start + (end - start) * (i as f64 / steps as f64),
    };
    Ok((0..=steps).map(at).collect())
}

/// Refuses a scene that cannot be numbered, that memory does not hold, or that has no triangles.
fn check_sizes(
    path: &Path,
    parts: &[Part],
    (keys, vertices): (usize, usize),
    notes: &[String],
    options: &Options,
) -> Result<()> {
    let count: usize = parts.iter().map(|p| p.triangles.len()).sum();
    check_keys(path, (keys, vertices, count), options)?;
    let all = vertices.saturating_mul(keys);
    within(path, "vertices in all key frames", all, MAX_POSITIONS)?;
    let hint = notes.first().map(|note| format!("; {note}"));
    check_counts(path, [vertices, count], &hint.unwrap_or_default())
}

#[cfg(test)]
mod tests;
