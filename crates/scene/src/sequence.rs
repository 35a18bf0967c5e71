//! Key frames from mesh files of equal topology, one per file.

use crate::folder::Folder;
use crate::mesh::{CLAY, Paint, Polygons, mean, renumber_used_vertices};
use crate::paging::{KeySize, check_keys, reserve};
use crate::paths::extension;
use crate::ply::{MeshFile, PlyTemplate};
use crate::polygon::{self, Triangulation};
use crate::rounding::{Position, Rounding};
use crate::{Facts, Result, Rgb, Scene, SceneError, SceneOptions, obj, paging, ply};
use geom::{Point, lock};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::SystemTime;

/// Reads a mesh file of either format. An OBJ file has no template, so each later file is parsed.
fn read(path: &Path) -> Result<MeshFile> {
    match extension(path).as_str() {
        "obj" => Ok(MeshFile {
            mesh: obj::read(path)?,
            template: None,
        }),
        _ => ply::read(path),
    }
}

/// Opens `files` as the key frames of one animation. There is at least one file, and all are `.obj` or all `.ply`.
///
/// The first key frame determines the triangulation of polygons. Later key frames must have the same faces, and use the
/// same triangles.
pub(crate) fn open(name: String, files: Vec<PathBuf>, options: &SceneOptions) -> Result<Scene> {
    let path = files[0].as_path();
    let MeshFile { mesh, template } = read(path)?;
    mesh.polygons.check(path)?;
    let found = polygon::triangulate(&mesh.polygons, &mesh.points);
    let Triangulation {
        mut triangles,
        fanned,
    } = found.map_err(|e| SceneError::unusable(path, e))?;
    let mut notes = mesh.notes;
    if fanned > 0 {
        let file = path.display();
        notes.push(format!(
            "{file}: {fanned} concave faces have too many vertices for ear clipping and become triangle fans"
        ));
    }
    let polygons = mesh.polygons;
    // One colour per triangle. This precedes the renumbering of vertices, because the colours of vertices are in the
    // order of the file.
    let colours: Vec<Rgb> = match mesh.paint {
        Paint::None => vec![CLAY; triangles.len()],
        Paint::Vertices(colours) => {
            let mean = |corners: &[u32; 3]| mean(corners.map(|v| colours[v as usize]));
            triangles.iter().map(mean).collect()
        }
        Paint::Faces(colours) => polygons.per_triangle(&colours),
        Paint::Materials(materials) => {
            let folder = Folder::of(path, options.allow_outside);
            let faces = polygons.faces().count();
            polygons.per_triangle(&materials.colours(path, &folder, faces, &mut notes))
        }
    };
    let kept = renumber_used_vertices(&mut triangles, polygons.vertices);
    let exact = pick(path, &mesh.points, &kept)?;
    drop(mesh.points);
    let rounding = Rounding::of(&exact, options);
    notes.extend(rounding.remarks(path, &exact, options));
    let first = rounding.points(&exact);
    drop(exact);
    let (keys, vertices) = (files.len(), kept.len());
    let size = KeySize { keys, vertices };
    check_keys(path, size, triangles.len(), options)?;
    let sequence = Arc::new(Sequence {
        stamps: files.iter().map(|_| OnceLock::new()).collect(),
        alike: files.iter().map(|_| AtomicBool::new(false)).collect(),
        files: files.clone(),
        polygons,
        template,
        rounding,
        kept,
        notes: Mutex::default(),
    });
    let read = Arc::clone(&sequence);
    let source = move |key| Ok(read.read(key)?);
    let animation = paging::animation(source, Some(first), size, triangles, options)?;
    notes.extend(lock(&sequence.notes).values().flatten().cloned());
    let facts = Facts {
        format: extension(&files[0]),
        files,
        offset: rounding.reported_offset(options),
        notes,
        ..Facts::default()
    };
    Ok(Scene {
        name,
        animation: Arc::new(animation),
        colours: colours.into(),
        facts,
    })
}

/// Returns the points of `vertices`.
fn pick(path: &Path, points: &[Position], vertices: &[u32]) -> Result<Vec<Position>> {
    let mut picked = Vec::new();
    let reserved = reserve(&mut picked, vertices.len());
    reserved.map_err(|e| SceneError::unusable(path, e))?;
    picked.extend(vertices.iter().map(|&v| points[v as usize]));
    Ok(picked)
}

/// Key-frame files, which are read again when a key frame is not in memory.
struct Sequence {
    files: Vec<PathBuf>,
    /// Size and modification time of each file when [`Self::read`] first opened it.
    stamps: Vec<OnceLock<Stamp>>,
    /// Whether each file is known to differ from the first in its vertices only.
    alike: Vec<AtomicBool>,
    /// Polygons of all files.
    polygons: Polygons,
    /// Template with which later files are compared byte by byte instead of being parsed. `None` for OBJ files and for
    /// some PLY files.
    template: Option<PlyTemplate>,
    /// Indices, as numbered in the files, of the vertices that faces use.
    kept: Vec<u32>,
    rounding: Rounding,
    /// Remarks on later files, by file index.
    notes: Mutex<BTreeMap<usize, Vec<String>>>,
}

/// State of a file when it was read.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl Sequence {
    fn read(&self, key: usize) -> Result<Vec<Point>> {
        let path = &self.files[key];
        self.check_unchanged(key)?;
        if let Some(template) = &self.template {
            if self.alike[key].load(Ordering::Relaxed) {
                let points = template.read_again(path, &self.kept)?;
                return Ok(self.rounding.points(&points));
            }
            if let Some(points) = template.read(path, &self.kept)? {
                self.alike[key].store(true, Ordering::Relaxed);
                return Ok(self.rounding.points(&points));
            }
        }
        let mesh = read(path)?.mesh;
        let (first, expected) = (&self.files[0], &self.polygons);
        mesh.polygons.check_same(path, first, expected)?;
        // Keeps only the remark that the file may be cut short. The other remarks usually repeat those of the first
        // file.
        let notes = mesh.notes.into_iter();
        let notes: Vec<_> = notes.filter(|note| note.contains("cut short")).collect();
        if !notes.is_empty() && key > 0 {
            lock(&self.notes).insert(key, notes);
        }
        let points = pick(path, &mesh.points, &self.kept)?;
        Ok(self.rounding.points(&points))
    }

    /// Checks that the size and time of a file match its stamp. `alike` is valid only for an unchanged file.
    fn check_unchanged(&self, key: usize) -> Result<()> {
        let path = &self.files[key];
        let metadata = fs::metadata(path).map_err(|e| SceneError::unreadable(path, e))?;
        let found = Stamp {
            bytes: metadata.len(),
            modified: metadata.modified().ok(),
        };
        if *self.stamps[key].get_or_init(|| found) == found {
            return Ok(());
        }
        let cause = "the file was changed while the scene was in use";
        Err(SceneError::unusable(path, cause))
    }
}
