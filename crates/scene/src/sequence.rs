//! Key frames from mesh files, one file each, all of one topology; and when they are, as `times.json` beside them says.

use crate::mesh::{CLAY, Mesh, Paint, Topology, check_keys, mean};
use crate::source::extension;
use crate::{Facts, Options, Rgb, Scene, SceneError, obj, ply};
use geom::{Animation, Point};
use host::Folder;
use rayon::prelude::*;
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads one key frame.
fn read(path: &Path) -> Result<Mesh, SceneError> {
    match extension(path).as_str() {
        "obj" => obj::read(path),
        _ => ply::read(path),
    }
}

/// The animation whose key frames are `files` of one extension, `obj` or `ply`, of which there is one at least.
pub(crate) fn open(
    name: String,
    files: Vec<PathBuf>,
    options: &Options,
) -> Result<Scene, SceneError> {
    let path = &files[0];
    let Mesh {
        points,
        triangles,
        topology,
        paint,
        mut notes,
    } = read(path)?;
    topology.check(path)?;
    let folder = Folder::of(path, options.allow_outside);
    let colours = colours((path, &folder), &topology, paint, &mut notes);
    let size = (files.len(), points.len(), triangles.len());
    check_keys(path.display(), size, options)?;
    let mut keys = vec![points];
    // Collected before looked at, so that the first bad file is named whichever thread is faster.
    let rest: Vec<_> = files[1..]
        .par_iter()
        .map(|later| key_frame(later, (path, &topology)))
        .collect();
    for frame in rest {
        let (points, remarks) = frame?;
        keys.push(points);
        notes.extend(remarks);
    }
    let animation = Arc::new(Animation::new(keys, triangles)?);
    let facts = Facts {
        format: extension(&files[0]),
        files,
        notes,
        ..Facts::default()
    };
    Ok(Scene {
        name,
        animation,
        colours,
        facts,
    })
}

/// The positions in a later file, and remarks, once its faces are known to be those of the first.
fn key_frame(
    path: &Path,
    first: (&Path, &Topology),
) -> Result<(Vec<Point>, Vec<String>), SceneError> {
    let mesh = read(path)?;
    mesh.topology.check_same(path, first)?;
    // Remarks that every file of a sequence repeats are told once, for the first.
    let notes = mesh
        .notes
        .into_iter()
        .filter(|note| note.contains("cut short"));
    Ok((mesh.points, notes.collect()))
}

/// One colour a triangle.
fn colours(
    place: (&Path, &Folder),
    topology: &Topology,
    paint: Paint,
    notes: &mut Vec<String>,
) -> Vec<Rgb> {
    match paint {
        Paint::None => vec![CLAY; topology.triangle_count()],
        Paint::Vertices(colours) => topology
            .triangles()
            .map(|(_, corners)| mean(corners.map(|v| colours[v as usize])))
            .collect(),
        Paint::Faces(colours) => topology
            .triangles()
            .map(|(face, _)| colours[face])
            .collect(),
        Paint::Materials { libraries, uses } => {
            let faces = obj::paint(place, &libraries, &uses, topology.faces().count(), notes);
            topology.triangles().map(|(face, _)| faces[face]).collect()
        }
    }
}

/// The file of times, as `abvh inspect --reduced-out` writes it.
#[derive(Deserialize)]
struct Times {
    end: f64,
    seconds_per_key: Option<f64>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    file: String,
    time: f64,
}

/// Gives the key frames of a directory the times that are written there, if any are.
pub(crate) fn apply_times(directory: &Path, mut scene: Scene) -> Result<Scene, SceneError> {
    let path = directory.join("times.json");
    let bytes = match host::read(&path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(scene),
        Err(e) => return Err(SceneError::unreadable(&path, e)),
    };
    let bad = |cause: String| SceneError::unusable(path.display(), cause);
    let times: Times = serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))?;
    let files = &scene.facts.files;
    let told = times.frames.iter().map(|f| f.file.as_str());
    let there = files.iter().map(|f| f.file_name().unwrap_or_default());
    if !told.eq(there) {
        let (told, there) = (times.frames.len(), files.len());
        return Err(bad(format!(
            "it tells when {told} key frames are, but not of the {there} files beside it, in their order"
        )));
    }
    let keys = times.frames.iter().map(|f| f.time).collect();
    let timed = Arc::unwrap_or_clone(scene.animation).timed(keys, times.end);
    scene.animation = Arc::new(timed.map_err(|e| bad(e.to_string()))?);
    scene.facts.seconds_per_key = times.seconds_per_key.or(scene.facts.seconds_per_key);
    Ok(scene)
}
