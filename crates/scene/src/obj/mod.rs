//! Wavefront OBJ: `tobj` reads numbers, fans faces and reads materials.
//!
//! `tobj` names no line, counts the vertices of each group anew, takes lines
//! (`l`) for faces and leaves out what it does not like about some of them;
//! so [`statements`] goes through the text first, refuses what is wrong with
//! the line it is in, and hands on plain vertices and faces only.

mod materials;
mod statements;

use crate::memory::check_mesh;
use crate::mesh::{Mesh, Paint};
use crate::{FileLocation, SceneError};
pub(crate) use materials::paint;
use statements::Statements;
use std::path::Path;

/// Reads one file.
pub(crate) fn read(path: &Path) -> Result<Mesh, SceneError> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    check_memory(path, &bytes)?;
    let found = Statements::scan(&bytes)
        .map_err(|e| SceneError::malformed(path, FileLocation::Line(e.line), e.cause))?;
    found.topology.check(path)?;
    let failed = |e: &dyn std::fmt::Display| SceneError::malformed(path, FileLocation::File, e);
    let options = tobj::LoadOptions {
        triangulate: true,
        ..tobj::LoadOptions::default()
    };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut found.plain.as_bytes(), &options, no_materials)
        .map_err(|e| failed(&e))?;
    // Without groups and materials in its text, tobj makes one model.
    let mesh = &models.first().ok_or_else(|| failed(&"no model"))?.mesh;
    let triangles = mesh.indices.as_chunks::<3>().0.to_vec();
    let points = mesh.positions.as_chunks::<3>().0.to_vec();
    if triangles.len() != found.topology.triangle_count() {
        return Err(failed(&"triangles were lost"));
    }
    let notes = found.notes(path);
    let paint = if !found.uses.is_empty() {
        Paint::Materials {
            libraries: found.libraries,
            uses: found.uses,
        }
    } else if found.colours.len() == found.topology.vertices {
        Paint::Vertices(found.colours)
    } else {
        Paint::None
    };
    Ok(Mesh {
        points,
        triangles,
        topology: found.topology,
        paint,
        notes,
    })
}

/// Refuses a text whose mesh memory does not hold: a copy for `tobj`, its lists, and ours.
fn check_memory(path: &Path, text: &[u8]) -> Result<(), SceneError> {
    const VERTEX: usize = 60;
    const FACE: usize = 60;
    const TRIANGLE: usize = 84;
    let (mut counts, mut need) = ([0, 0], text.len());
    for line in text.split(|&b| b == b'\n') {
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => {
                counts[0] += 1;
                need += VERTEX;
            }
            Some(b"f") => {
                counts[1] += 1;
                need += FACE + TRIANGLE * words.count().saturating_sub(2);
            }
            _ => {}
        }
    }
    check_mesh(path, counts, need)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn parse(text: &str) -> Result<Mesh, String> {
        let file = tempfile::Builder::new().suffix(".obj").tempfile().unwrap();
        fs::write(file.path(), text).unwrap();
        read(file.path()).map_err(|e| e.to_string())
    }

    #[test]
    fn triangles_come_in_file_order_whatever_groups_and_lines_say() {
        let mesh = parse(
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\ng b\nusemtl m\nf 1 2 3 4\n\
             g a\nl 1 2 3\nf -1/1/1 -2/1/1 -4//1 # a comment\nusemtl n\nf 2 \\\n 3 4\n",
        )
        .unwrap();
        let at = |t: [u32; 3]| t.map(|v| mesh.points[v as usize][..2].to_vec());
        let (a, b, c, d) = (
            vec![0.0, 0.0],
            vec![1.0, 0.0],
            vec![1.0, 1.0],
            vec![0.0, 1.0],
        );
        let expected = [[&a, &b, &c], [&a, &c, &d], [&d, &c, &a], [&b, &c, &d]];
        assert_eq!(mesh.triangles.len(), 4);
        for (&found, expected) in mesh.triangles.iter().zip(expected) {
            assert_eq!(at(found).each_ref(), expected);
        }
        assert!(
            mesh.notes
                .iter()
                .any(|n| n.contains("line 11") && n.contains("'l'")),
            "{:?}",
            mesh.notes
        );
    }

    #[test]
    fn a_bad_statement_is_named_by_its_line() {
        let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\n\n";
        for (text, says) in [
            ("f 1 2 4\n", "line 5: vertex 4 does not exist, there are 3"),
            ("f 1 2 0\n", "line 5: vertex 0"),
            ("f 1 2 -4\n", "line 5: vertex -4"),
            ("f 1 2\n", "line 5: a face of 2 vertices"),
            ("f\n", "line 5: a face of 0 vertices"),
            ("f 1 2 x\n", "line 5: \"x\""),
            ("f 1 2 3/y\n", "line 5: \"3/y\""),
            ("f 1 2 3/1/1/1\n", "line 5: \"3/1/1/1\""),
            ("f 1 2 /3\n", "line 5: \"/3\""),
            ("f 1 2 99999999999999999999\n", "line 5"),
            ("f 1 2 3\nv 1 2\n", "line 6: a vertex of 2 numbers"),
            (
                "f 1 2 3\nv 1 2 1.0.0\n",
                "line 6: \"1.0.0\" is not a number",
            ),
            ("f 1 2 3\nv 1 2 3 0\n", "line 6: w is 0"),
            ("f 1 2 3\nv 1 2 3 4 5\n", "line 6: a vertex of 5 numbers"),
            ("f 1 2 3\nv 1 2 3 x y z\n", "line 6: \"x\" is not a number"),
        ] {
            let message = parse(&format!("{head}{text}")).err().unwrap();
            assert!(message.contains(says), "{text:?}: {message}");
            assert!(!message.contains('\n'));
        }
        assert!(parse("").err().unwrap().contains("no triangles"));
        assert!(parse(head).err().unwrap().contains("3 vertices"));
        assert!(
            parse("\u{0}\u{1}\u{2}")
                .err()
                .unwrap()
                .contains("no triangles")
        );
    }

    #[test]
    fn numbers_that_are_none_are_accepted_where_a_vertex_may_be_absent() {
        let mesh =
            parse("v nan 0 0\nv inf 0 -INF\nv 1e99 1 0\nv 2 4 6 2\nf 1 2 3\nf 4 2 3\n").unwrap();
        let [a, b, c, d] = mesh.points[..] else {
            panic!("four vertices")
        };
        assert!(a[0].is_nan() && b[0].is_infinite() && c[0].is_infinite());
        assert_eq!(d, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn long_polygons_forward_references_and_foreign_bytes_are_read() {
        let mut text = String::from("# caf\u{e9}\ng na\u{ef}ve\nf");
        (1..=1000).for_each(|i| text.push_str(&format!(" {i}")));
        (1..=1000).for_each(|i| text.push_str(&format!("\r\nv {i} 0 0")));
        let mesh = parse(&text).unwrap();
        assert_eq!(mesh.triangles.len(), 998);
        assert!(mesh.notes.iter().any(|n| n.contains("cut short")));
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        assert_eq!(Statements::scan(&latin).unwrap().topology, mesh.topology);
    }
}
