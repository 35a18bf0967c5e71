//! Reader of glTF files: samples one animation clip to vertex key frames.
//!
//! It follows the glTF 2.0 specification (Khronos). Node transforms, skins and morph targets are evaluated in double
//! precision at each key frame, and rounded once. Textures, cameras and lights are not read.

mod accessor;
mod container;
mod document;
mod motion;
mod part;
mod rig;
mod schema;
mod transform;

use crate::mesh::joined_triangles;
use crate::paging::{KeySize, check_counts, check_keys, reserve, within};
use crate::paths::extension;
use crate::rounding::Rounding;
use crate::{Facts, MAX_FPS, Result, Scene, SceneError, SceneOptions, paging};
use document::GltfFile;
pub(crate) use document::buffer_files;
use motion::ClipMotion;
use part::{ClipPart, Drawn};
use rig::Rig;
use std::path::Path;
use std::sync::Arc;

const MAX_KEYS: usize = 1 << 16;
/// Maximum number of vertices in all key frames together. They take 48 GiB.
const MAX_POSITIONS: usize = 1 << 32;

pub(crate) fn open(name: String, path: &Path, options: &SceneOptions) -> Result<Scene> {
    let fps = options.fps;
    if !(fps > 0.0 && fps <= MAX_FPS) {
        return Err(SceneError(format!(
            "bad frame rate {fps}: it must be above 0 and at most {MAX_FPS} frames per second"
        )));
    }
    let mut file = GltfFile::open(path, options.allow_outside)?;
    let mut notes = std::mem::take(&mut file.notes);
    let rig = Rig::new(&file)?;
    let drawn = Drawn::of(&file, &rig)?;
    let skipped = drawn.skipped();
    let parts = drawn.parts;
    notes.extend(drawn.notes);
    let clip = choose(&file, options, &mut notes)?;
    let motion = ClipMotion::of(&file, clip.map(|i| &file.document.animations[i]))?;
    let times = times(path, motion.span(), fps)?;
    let vertices = parts.iter().map(ClipPart::vertices);
    let vertices = vertices.fold(0, usize::saturating_add);
    let count = parts.iter().map(ClipPart::triangle_count);
    let count = count.fold(0, usize::saturating_add);
    let keys = times.len();
    let size = KeySize { keys, vertices };
    check_keys(path, size, count, options)?;
    let all = vertices.saturating_mul(keys);
    within(path, "vertices in all key frames", all, MAX_POSITIONS)?;
    let hint = skipped.iter().map(|note| format!("; {note}"));
    check_counts(path, [vertices, count], &hint.collect::<String>())?;
    notes.extend(skipped);
    let colours = parts.iter().flat_map(ClipPart::colours).collect();
    let triangles = joined_triangles(path, parts.iter().flat_map(ClipPart::meshes))?;
    let seconds_per_key = times.get(1).map(|t| t - times[0]);
    let place = path.to_owned();
    let positions = move |key: usize| {
        let time = times[key];
        let pose = rig.pose(&motion, time);
        // Allocates the exact capacity. A growing list would need more memory than its points.
        let mut points = Vec::new();
        let reserved = reserve(&mut points, vertices);
        reserved.map_err(|e| SceneError::unusable(&place, e))?;
        for part in &parts {
            part.add_positions(&pose, &motion, time, &mut points);
        }
        Ok::<_, SceneError>(points)
    };
    let exact = positions(0)?;
    let rounding = Rounding::of(&exact, options);
    notes.extend(rounding.remarks(path, &exact, options));
    let facts = Facts {
        format: extension(path),
        files: vec![path.to_owned()],
        clip: clip.map(|i| clip_name(&file, i)),
        seconds_per_key,
        offset: rounding.reported_offset(options),
        notes,
    };
    let first = rounding.points(&exact);
    drop(exact);
    let source = move |key: usize| Ok(rounding.points(&positions(key)?));
    let animation = paging::animation(source, Some(first), size, triangles, options)?;
    Ok(Scene {
        name,
        animation: Arc::new(animation),
        colours,
        facts,
    })
}

fn clip_name(file: &GltfFile, clip: usize) -> String {
    let name = file.document.animations[clip].name.clone();
    name.unwrap_or_else(|| clip.to_string())
}

/// Returns the index of the requested clip, matched by name and then by index. The default is the first clip.
fn choose(
    file: &GltfFile,
    options: &SceneOptions,
    notes: &mut Vec<String>,
) -> Result<Option<usize>> {
    let clips = 0..file.document.animations.len();
    let all: Vec<_> = clips.clone().map(|i| clip_name(file, i)).collect();
    let Some(requested) = &options.clip else {
        if all.len() > 1 {
            let (count, names) = (all.len(), all.join(", "));
            notes.push(format!("took the first of {count} clips: {names}"));
        }
        return Ok(clips.min());
    };
    let named = all.iter().position(|name| name == requested);
    let index = named.or_else(|| requested.parse().ok());
    if let Some(clip) = index.filter(|i| clips.contains(i)) {
        return Ok(Some(clip));
    }
    let numbered = |(i, name): (usize, &String)| format!("{i} {name:?}");
    let numbered: Vec<_> = all.iter().enumerate().map(numbered).collect();
    let there = if all.is_empty() {
        "the file has no clips".to_owned()
    } else {
        format!("there are {}", numbered.join(", "))
    };
    let cause = format!("no clip {requested:?}; {there}");
    Err(SceneError::unusable(&file.path, cause))
}

/// Returns evenly spaced times in seconds from the start to the end of the clip. Apart from the tolerance below, there
/// are at least `fps` per second.
fn times(path: &Path, [start, end]: [f64; 2], fps: f64) -> Result<Vec<f64>> {
    // The tolerance keeps rounding errors from adding a key frame: 2.0000001 intervals count as 2.
    let steps = ((end - start) * fps - 1e-4).ceil().max(0.0) as usize;
    within(path, "key frames", steps.saturating_add(1), MAX_KEYS)?;
    let at = |i: usize| {
        if i == steps {
            return end;
        }
        start + (end - start) * (i as f64 / steps as f64)
    };
    Ok((0..=steps).map(at).collect())
}

#[cfg(test)]
mod tests;
