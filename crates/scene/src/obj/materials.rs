//! Diffuse colours from material libraries (MTL). A library that cannot be read costs colours, never the scene: it is noted.

use crate::Rgb;
use crate::mesh::{CLAY, from_display};
use host::Folder;
use std::collections::BTreeMap;
use std::path::Path;

/// One colour a face for the OBJ file at `path`.
pub(crate) fn paint(
    (path, folder): (&Path, &Folder),
    libraries: &[String],
    uses: &[(usize, String)],
    faces: usize,
    notes: &mut Vec<String>,
) -> Vec<Rgb> {
    let mut materials = BTreeMap::new();
    for library in libraries {
        read_library(folder, library, &mut materials, notes);
    }
    let mut colours = vec![CLAY; faces];
    let ends = uses.iter().skip(1).map(|u| u.0).chain([faces]);
    let mut missing = 0;
    for ((start, name), end) in uses.iter().zip(ends) {
        match materials.get(name) {
            Some(&colour) => colours[*start..end].fill(colour),
            None => missing += 1,
        }
    }
    if missing > 0 {
        let all = uses.len();
        notes.push(format!(
            "{}: {missing} of {all} uses of materials name none with a colour",
            path.display()
        ));
    }
    colours
}

/// Adds the materials of one library: a file name with spaces, or several without.
fn read_library(
    folder: &Folder,
    library: &str,
    into: &mut BTreeMap<String, Rgb>,
    notes: &mut Vec<String>,
) {
    let library = library.replace('\\', "/");
    let names = match folder.path(&library).exists() {
        true => vec![library.as_str()],
        false => library.split_whitespace().collect(),
    };
    for name in names {
        match folder.read(name) {
            Ok(bytes) => add_colours(&String::from_utf8_lossy(&bytes), into),
            Err(e) => {
                let file = folder.path(name);
                let file = file.display();
                notes.push(format!("{file}: material library left out: {e}"));
            }
        }
    }
}

/// Adds what `Kd` lines of one number or three say of the material named before them; other lines are left out.
fn add_colours(text: &str, into: &mut BTreeMap<String, Rgb>) {
    let mut material = "";
    for line in text.lines().map(str::trim) {
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let numbers: Option<Vec<f32>> = rest.split_whitespace().map(|n| n.parse().ok()).collect();
        let colour = match (word, numbers.as_deref()) {
            ("Kd", Some(&[r, g, b])) => [r, g, b],
            // One number stands for all three.
            ("Kd", Some(&[grey])) => [grey; 3],
            ("newmtl", _) if !rest.is_empty() => {
                material = rest.trim_start();
                continue;
            }
            _ => continue,
        };
        if !material.is_empty() {
            into.insert(material.to_owned(), from_display(colour));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::put;

    #[test]
    fn faces_take_the_diffuse_colour_of_their_material_from_libraries_that_may_be_read() {
        let all = tempfile::tempdir().unwrap();
        let library = "newmtl red paint\nKa 1 1\nKd 1 0 0\nmap_Kd\nnewmtl grey\nKd 0.2\nnewmtl broken\nKd 1 2\n";
        put(&all, "scene/my colours.mtl", library);
        put(&all, "outside.mtl", "newmtl blue\nKd 0 0 1\n");
        let names = ["red paint", "grey", "broken", "none", "blue"];
        let uses: Vec<_> = (1..).zip(names.map(str::to_owned)).collect();
        let libraries = [
            "my colours.mtl",
            "absent.mtl",
            "/dev/zero",
            "../outside.mtl",
        ];
        let libraries = libraries.map(str::to_owned);
        let obj = all.path().join("scene/a.obj");
        let with = |allow_outside| {
            let (folder, mut notes) = (Folder::of(&obj, allow_outside), Vec::new());
            let found = paint((&obj, &folder), &libraries, &uses, 6, &mut notes);
            assert_eq!(found[..5], [CLAY, [255, 0, 0], [51, 51, 51], CLAY, CLAY]);
            (found[5], notes)
        };
        let (colour, notes) = with(false);
        assert_eq!(colour, CLAY);
        let says = ["absent.mtl", "--allow", "--allow", "3 of 5"];
        for (note, says) in notes.iter().zip(says) {
            assert!(note.contains(says), "{note}");
        }
        let (colour, notes) = with(true);
        assert_eq!(colour, [0, 0, 255]);
        assert!(notes[1].contains("a device"), "{notes:?}");
    }
}
