//! Diffuse colours from material libraries (MTL), parsed by `tobj`.
//!
//! If a library is missing or malformed, the scene opens with a remark and without these colours. `tobj` receives only
//! `newmtl` and well-formed `Kd` lines. It would panic on a short `Kd`, and other lines could make it refuse the
//! library.

use crate::Rgb;
use crate::folder::Folder;
use crate::mesh::{CLAY, Materials, srgb_bytes};
use crate::paths::encode;
use crate::text::{check_encoding, lines};
use std::collections::BTreeMap;
use std::path::Path;

impl Materials {
    /// Returns one colour for each of `faces` faces of the OBJ file at `path`.
    pub(crate) fn colours(
        &self,
        path: &Path,
        folder: &Folder,
        faces: usize,
        notes: &mut Vec<String>,
    ) -> Vec<Rgb> {
        let mut materials = BTreeMap::new();
        for library in &self.libraries {
            read_library(folder, library, &mut materials, notes);
        }
        let mut colours = vec![CLAY; faces];
        let ends = self.uses.iter().skip(1).map(|u| u.first_face);
        let mut missing = 0;
        for (used, end) in self.uses.iter().zip(ends.chain([faces])) {
            match materials.get(&used.name) {
                Some(&colour) => colours[used.first_face..end].fill(colour),
                None => missing += 1,
            }
        }
        if missing > 0 {
            let (file, all) = (path.display(), self.uses.len());
            notes.push(format!(
                "{file}: {missing} of {all} uses of materials refer to no material with a colour"
            ));
        }
        colours
    }
}

/// Returns the names of the files that a `mtllib` statement refers to: one name, which may contain spaces, or several
/// separated by spaces.
pub(crate) fn library_names(folder: &Folder, statement: &str) -> Vec<String> {
    let names = statement.replace('\\', "/");
    if folder.path(&names).exists() {
        vec![names]
    } else {
        names.split_whitespace().map(str::to_owned).collect()
    }
}

/// Adds the materials of a `mtllib` statement.
fn read_library(
    folder: &Folder,
    library: &str,
    into: &mut BTreeMap<String, Rgb>,
    notes: &mut Vec<String>,
) {
    for name in library_names(folder, library) {
        let file = folder.path(&name);
        let read = folder.read(&name).map_err(|e| e.to_string());
        let found = read.and_then(|bytes| {
            check_encoding(&bytes)?;
            let text = colour_statements(&bytes);
            tobj::load_mtl_buf(&mut text.as_bytes()).map_err(|e| e.to_string())
        });
        match found {
            Ok((materials, _)) => {
                let coloured = |m: tobj::Material| Some((m.name, srgb_bytes(m.diffuse?)));
                into.extend(materials.into_iter().filter_map(coloured));
            }
            Err(e) => notes.push(format!(
                "{}: skipped the material library: {e}",
                file.display()
            )),
        }
    }
}

/// Returns the `newmtl` lines with a name, and the `Kd` lines with one or three numbers.
fn colour_statements(text: &[u8]) -> String {
    let mut plain = String::new();
    for line in lines(text).map(encode) {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let numbers: Option<Vec<f32>> = rest.split_whitespace().map(|n| n.parse().ok()).collect();
        match (word, numbers.as_deref()) {
            ("newmtl", _) if !rest.trim().is_empty() => {
                plain += &format!("newmtl {}\n", rest.trim())
            }
            ("Kd", Some([r, g, b])) => plain += &format!("Kd {r} {g} {b}\n"),
            // A single number applies to all three components.
            ("Kd", Some([grey])) => plain += &format!("Kd {grey} {grey} {grey}\n"),
            _ => {}
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::MaterialUse;
    use std::fs;

    #[test]
    fn faces_use_material_diffuse_colours() {
        let all = tempfile::tempdir().unwrap();
        fs::create_dir(all.path().join("scene")).unwrap();
        let library = "newmtl red paint\nKa 1 1\nKd 1 0 0\nmap_Kd\nnewmtl grey\nKd 0.2\nnewmtl broken\nKd 1 2\n";
        fs::write(all.path().join("scene/my colours.mtl"), library).unwrap();
        fs::write(all.path().join("outside.mtl"), "newmtl blue\nKd 0 0 1\n").unwrap();
        let names = ["red paint", "grey", "broken", "none", "blue"];
        let uses = (1..).zip(names.map(str::to_owned));
        let uses = uses.map(|(first_face, name)| MaterialUse { first_face, name });
        let libraries = [
            "my colours.mtl",
            "absent.mtl",
            "/dev/zero",
            "../outside.mtl",
        ];
        let materials = Materials {
            libraries: libraries.map(str::to_owned).to_vec(),
            uses: uses.collect(),
        };
        let obj = all.path().join("scene/a.obj");
        let with = |allow_outside| {
            let (folder, mut notes) = (Folder::of(&obj, allow_outside), Vec::new());
            let found = materials.colours(&obj, &folder, 6, &mut notes);
            assert_eq!(found[..5], [CLAY, [255, 0, 0], [51, 51, 51], CLAY, CLAY]);
            (found[5], notes)
        };
        let (colour, notes) = with(false);
        assert_eq!(colour, CLAY);
        for (note, says) in notes
            .iter()
            .zip(["absent.mtl", "--allow", "--allow", "3 of 5"])
        {
            assert!(note.contains(says), "{note}");
        }
        let (colour, notes) = with(true);
        assert_eq!(colour, [0, 0, 255]);
        assert!(notes[1].contains("a device"), "{notes:?}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn latin_1_names_are_distinct() {
        use crate::testing::put;
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join(OsStr::from_bytes(b"\xe9.mtl"));
        fs::write(library, b"newmtl \xe8\nKd 1 0 0\nnewmtl \xe9\nKd 0 1 0\n").unwrap();
        let obj = b"mtllib \xe9.mtl\n\xe9tat\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl \xe8\nf 1 2 3\nusemtl \xe9\nf 1 2 3\n";
        let name = put(&folder, "a.obj", obj).display().to_string();
        let scene = crate::open(&name, &crate::SceneOptions::default()).unwrap();
        assert_eq!(scene.colours[..], [[255, 0, 0], [0, 255, 0]]);
        assert_eq!(crate::files(&name, false).unwrap().len(), 2);
        let notes = &scene.facts.notes;
        assert!(
            notes.len() == 1 && notes[0].contains("tat'") && !notes[0].contains('\0'),
            "{notes:?}"
        );
    }
}
