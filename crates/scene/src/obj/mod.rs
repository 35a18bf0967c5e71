//! Reader of Wavefront OBJ files: vertices, polygons and their colours. Statements for normals, texture coordinates,
//! curve parameters, groups and rendering are skipped silently. Other statements that the reader does not use, such as
//! lines (`l`), are skipped with a remark.
//!
//! `tobj` reads only the material libraries. It is not used for meshes because its errors name no line, it drops faces
//! silently, and it reads lines (`l`) as faces.

mod materials;

pub(crate) use materials::library_names;

use crate::mesh::{
    MaterialUse, Materials, Paint, PolygonMesh, Polygons, SHORT_FACES, Skipped, append, to_srgb,
};
use crate::paths::{decode_path, encode};
use crate::rounding::Position;
use crate::text::{before_comment, check_encoding, lines, number};
use crate::{Result, SceneError};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::iter;
use std::path::Path;

pub(crate) fn read(path: &Path) -> Result<PolygonMesh> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    check_encoding(&bytes).map_err(|cause| SceneError::malformed(path, None, cause))?;
    let found = Statements::scan(path, &bytes)?;
    let mut notes = found.notes(path);
    let paint = if !found.materials.uses.is_empty() {
        Paint::Materials(found.materials)
    } else if found.colours.len() == found.points.len() {
        Paint::Vertices(to_srgb(&found.colours, path, &mut notes))
    } else {
        Paint::None
    };
    Ok(PolygonMesh {
        points: found.points,
        polygons: found.polygons,
        paint,
        notes,
    })
}

/// Contents of a file that the reader uses.
#[derive(Default)]
struct Statements {
    points: Vec<Position>,
    /// Faces with at least three vertices.
    polygons: Polygons,
    /// One colour per vertex. The list is shorter if some vertex has no colour.
    colours: Vec<[f32; 3]>,
    materials: Materials,
    /// Line number of each face.
    face_lines: Vec<usize>,
    /// Vertices of the current face.
    corners: Vec<u32>,
    /// Faces with fewer than three vertices.
    short_faces: Skipped,
    /// Skipped statements by keyword.
    skipped: BTreeMap<String, Skipped>,
    /// Whether the last line lacks a line end.
    open_end: bool,
}

impl Statements {
    fn scan(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut found = Self {
            open_end: !bytes.ends_with(b"\n") && !bytes.ends_with(b"\r") && !bytes.is_empty(),
            ..Self::default()
        };
        let mut last_line = 0;
        for (number, statement) in statements(bytes) {
            last_line = number;
            let done = found.statement(number, &statement);
            done.map_err(|e| SceneError::malformed(path, ("line", number), e))?;
        }
        if found.open_end && found.short_faces.last == Some(("line", last_line)) {
            let cause =
                "a face of fewer than 3 vertices in an unterminated line; the file is cut short";
            return Err(SceneError::malformed(path, ("line", last_line), cause));
        }
        found.polygons.vertices = found.points.len();
        found.check_references(path)?;
        Ok(found)
    }

    fn statement(&mut self, line: usize, text: &str) -> Result<(), String> {
        let text = text.trim();
        let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        match word {
            "v" => self.vertex(before_comment(rest))?,
            "f" | "fo" => self.face(line, before_comment(rest))?,
            // Material names may contain '#'.
            "usemtl" => {
                let (first_face, name) = (self.face_lines.len(), rest.trim().to_owned());
                append(&mut self.materials.uses, MaterialUse { first_face, name })?;
            }
            "mtllib" => self.materials.libraries.push(rest.trim().to_owned()),
            // These statements do not affect triangles.
            "" | "vt" | "vn" | "vp" | "g" | "o" | "s" | "mg" | "usemap" | "maplib" | "lod"
            | "shadow_obj" | "trace_obj" => {}
            word if word.starts_with('#') => {}
            word => {
                let word = decode_path(word).display().to_string();
                let word = word.chars().take(24).collect();
                self.skipped.entry(word).or_default().add(("line", line));
            }
        }
        Ok(())
    }

    /// Parses `x y z`, `x y z w`, `x y z r g b` or `x y z r g b a`. The weight `w` only affects curves and surfaces.
    fn vertex(&mut self, data: &str) -> Result<(), String> {
        let mut numbers = [0.0_f64; 7];
        let mut count = 0;
        for word in data.split_ascii_whitespace() {
            let value = number(word).ok_or_else(|| format!("{word:?} is not a number"))?;
            if let Some(slot) = numbers.get_mut(count) {
                *slot = value;
            }
            count += 1;
        }
        if !matches!(count, 3 | 4 | 6 | 7) {
            return Err(format!(
                "a vertex of {count} numbers; expected 3, 4 with a weight, 6 with a colour, or 7 with an alpha"
            ));
        }
        let [x, y, z, r, g, b, _] = numbers;
        if count > 4 && self.colours.len() == self.points.len() {
            append(&mut self.colours, [r, g, b].map(|c| c as f32))?;
        }
        append(&mut self.points, [x, y, z])
    }

    fn face(&mut self, line: usize, data: &str) -> Result<(), String> {
        self.corners.clear();
        for word in data.split_ascii_whitespace() {
            let corner = corner(word, self.points.len())?;
            append(&mut self.corners, corner)?;
        }
        if self.corners.len() < 3 {
            self.short_faces.add(("line", line));
            return Ok(());
        }
        self.polygons.push(&self.corners)?;
        append(&mut self.face_lines, line)
    }

    /// Refuses faces with undefined vertices. Runs at the end of the file, because a face may precede its vertices.
    fn check_references(&self, path: &Path) -> Result<()> {
        let vertices = self.points.len();
        for (&line, corners) in self.face_lines.iter().zip(self.polygons.faces()) {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                let vertex = u64::from(vertex) + 1;
                let cause = format!("vertex {vertex} does not exist, there are {vertices}");
                return Err(SceneError::malformed(path, ("line", line), cause));
            }
        }
        Ok(())
    }

    fn notes(&self, path: &Path) -> Vec<String> {
        let file = path.display();
        let skipped = self.skipped.iter();
        let notes = skipped
            .filter_map(|(word, skipped)| skipped.note(path, &format!("'{word}' statements")));
        let mut notes: Vec<_> = notes.collect();
        notes.extend(self.short_faces.note(path, SHORT_FACES));
        if self.open_end {
            notes.push(format!(
                "{file}: the last line is unterminated; the file may be cut short"
            ));
        }
        notes
    }
}

/// Splits a file into statements, each with the number of its first line. Skips a byte order mark, and joins continued
/// lines.
pub(crate) fn statements(bytes: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let text = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let mut numbered = (1..).zip(lines(text).map(encode));
    iter::from_fn(move || {
        let (number, line) = numbered.next()?;
        let statement = match continued(&line) {
            None => line,
            Some(head) => Cow::Owned(joined(head, numbered.by_ref().map(|(_, line)| line))),
        };
        Some((number, statement))
    })
}

/// Returns the part before the backslash if the line continues in the next one. A backslash in a comment does not
/// continue the line.
fn continued(line: &str) -> Option<&str> {
    before_comment(line).trim_end().strip_suffix('\\')
}

/// Joins a line with its continuation lines.
fn joined<'a>(head: &str, rest: impl Iterator<Item = Cow<'a, str>>) -> String {
    let mut whole = head.to_owned();
    for line in rest {
        whole.push(' ');
        let Some(part) = continued(&line) else {
            whole.push_str(&line);
            break;
        };
        whole.push_str(part);
    }
    whole
}

/// Returns the vertex index, counted from 0, of `v`, `v/vt`, `v//vn` or `v/vt/vn`. Negative numbers count back from the
/// last of `vertices`.
fn corner(word: &str, vertices: usize) -> Result<u32, String> {
    let malformed = || format!("{word:?} is not a face's vertex");
    let mut parts = word.split('/');
    let index = parts.next().and_then(|p| p.parse::<i64>().ok());
    let index = index.ok_or_else(malformed)?;
    let mut rest = parts.clone();
    if parts.count() > 2 || !rest.all(|p| p.is_empty() || p.parse::<i64>().is_ok()) {
        return Err(malformed());
    }
    let from_zero = if index < 0 {
        vertices as i64 + index
    } else {
        index - 1
    };
    u32::try_from(from_zero).map_err(|_| match index {
        0 => "vertex 0: numbers start at 1".to_owned(),
        i64::MIN..0 => format!("vertex {index} lies before the first of {vertices} vertices"),
        _ => format!("vertex {index} does not exist, there are {vertices}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rounding::Rounding;
    use crate::testing::{assert_note, refused, surface};
    use std::fs;

    fn parse(text: &str) -> Result<PolygonMesh> {
        let file = tempfile::Builder::new().suffix(".obj").tempfile().unwrap();
        fs::write(file.path(), text).unwrap();
        read(file.path())
    }

    #[test]
    fn triangles_are_in_file_order() {
        let mesh = parse(
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\ng b\nusemtl m\nf 1 2 3 4\n\
             g a\nl 1 2 3\nf -1/1/1 -2/1/1 -4//1 # a comment\nusemtl n\nf 2 \\\n 3 4\n",
        )
        .unwrap();
        let surface = surface(&mesh);
        let at = |v: u32| [0, 1].map(|axis| surface.points[v as usize][axis]);
        let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let found: Vec<_> = surface.triangles.iter().map(|t| t.map(at)).collect();
        assert_eq!(found, [[a, b, c], [a, c, d], [d, c, a], [b, c, d]]);
        let names_line = |n: &String| n.contains("line 11") && n.contains("'l'");
        assert!(mesh.notes.iter().any(names_line), "{:?}", mesh.notes);
    }

    #[test]
    fn errors_name_the_line() {
        let head = "v 0 0 0\nv 1 0 0\nv 0 1 0\n\n";
        for (text, says) in [
            ("f 1 2 4\n", "line 5: vertex 4 does not exist, there are 3"),
            ("f 1 2 0\n", "line 5: vertex 0"),
            ("f 1 2 -4\n", "line 5: vertex -4"),
            ("f 1 2 x\n", "line 5: \"x\""),
            ("f 1 2 3/y\n", "line 5: \"3/y\""),
            ("f 1 2 3/1/1/1\n", "line 5: \"3/1/1/1\""),
            ("f 1 2 /3\n", "line 5: \"/3\""),
            ("f 1 2 99999999999999999999\n", "line 5"),
            ("f 1 2 3\nf 1", "line 6: a face of fewer than 3 vertices"),
            ("f 1 2 3\nv 1 2\n", "line 6: a vertex of 2 numbers"),
            (
                "f 1 2 3\nv 1 2 1.0.0\n",
                "line 6: \"1.0.0\" is not a number",
            ),
            ("f 1 2 3\nv 1 2 3 4 5\n", "line 6: a vertex of 5 numbers"),
            ("f 1 2 3\nv 1 2 3 x y z\n", "line 6: \"x\" is not a number"),
        ] {
            refused(parse(&format!("{head}{text}")), &[says]);
        }
    }

    #[test]
    fn accepts_non_finite_coordinates() {
        let mesh =
            parse("v nan 0 0\nv inf 0 -INF\nv 1e99 1 0\nv 2 4 6 2\nf 1 2 3\nf 4 2 3\n").unwrap();
        let [a, b, c, d] = mesh.points[..] else {
            panic!("four vertices")
        };
        assert!(a[0].is_nan() && b[0].is_infinite());
        assert!(Rounding::default().point(c)[0].is_infinite());
        assert_eq!(d, [2.0, 4.0, 6.0]);
    }

    #[test]
    fn reads_forward_references_and_long_polygons() {
        let mut text = String::from("# caf\u{e9}\ng na\u{ef}ve\nf");
        (1..=1000).for_each(|i| text.push_str(&format!(" {i}")));
        (1..=1000).for_each(|i| text.push_str(&format!("\r\nv {i} 0 0")));
        let mesh = parse(&text).unwrap();
        assert_eq!(surface(&mesh).triangles.len(), 998);
        assert!(mesh.notes.iter().any(|n| n.contains("cut short")));
        let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
        assert_eq!(
            Statements::scan(Path::new(""), &latin).unwrap().polygons,
            mesh.polygons
        );
    }

    #[test]
    fn comment_ends_at_line_end() {
        for comment in [
            "# saved to D:\\out\\",
            "  # a \\  ",
            "#\\",
            "v 9 9 9 # b\\",
            "g part # c\\\r",
            "f 1 1 1# d\\",
        ] {
            let text = format!("v 9 9 9\n{comment}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n");
            let mesh = parse(&text).unwrap();
            let points = &mesh.points[mesh.points.len() - 3..];
            assert_eq!(points, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        }
        let mesh = parse("v 0 \\ # x\n1 \\\n\\\n2 # y \\\nv 1 0 0\nv 0 1 0\nf 1 2 3").unwrap();
        assert_eq!(mesh.points[0], [0.0, 1.0, 2.0]);
        assert_eq!(mesh.points.len(), 3);
    }

    #[test]
    fn vertex_weight_is_ignored() {
        for w in ["0", "2", "-1", "nan", "0.5"] {
            let mesh = parse(&format!("v 2 4 6 {w}\nv 1 0 0\nv 0 1 0 1\nf 1 2 3\n")).unwrap();
            assert_eq!(mesh.points[0], [2.0, 4.0, 6.0]);
            assert!(matches!(mesh.paint, Paint::None));
        }
    }

    #[test]
    fn accepts_carriage_return_line_ends() {
        let text = "# head\nmtllib a.mtl\n\nv 0 0 0\nv 1 0 0\nv 0 1 \\\n0\nl 1 2\nf 1 2 3\n";
        let whole = parse(text).unwrap();
        for end in ["\r", "\r\n"] {
            let mesh = parse(&text.replace('\n', end)).unwrap();
            assert_eq!(mesh.points, whole.points);
            assert_eq!(mesh.polygons, whole.polygons);
            assert_note(&mesh, "'l' statements, the first in line 8");
            assert_eq!(mesh.notes.len(), 1, "{:?}", mesh.notes);
            let wrong = text.replace("1 2 3", "1 2 4").replace('\n', end);
            refused(parse(&wrong), &["line 9: vertex 4"]);
        }
    }

    #[test]
    fn msvc_numbers_are_not_comments() {
        for word in ["-1.#IND", "1.#QNAN", "1.#INF00", "-nan(ind)"] {
            let text = format!("v {word} 0 0\nv 0 0 0\nv 1 0 {word}# x\nv 0 1 0\nf 2 3 4\n");
            let mesh = parse(&text).unwrap();
            assert!(!mesh.points[0][0].is_finite() && !mesh.points[2][2].is_finite());
        }
        refused(parse("v 1.#ind 0 0\n"), &["a vertex of 1 numbers"]);
    }

    #[test]
    fn faces_below_three_vertices_are_skipped() {
        let text =
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2\nusemtl b\nf 1 2 3\nf\nf 2/1\nf 3 2 1\n";
        let mesh = parse(text).unwrap();
        assert_eq!(surface(&mesh).triangles, [[0, 1, 2], [2, 1, 0]]);
        assert_note(
            &mesh,
            "skipped 3 faces of fewer than 3 vertices, the first in line 5",
        );
        let Paint::Materials(materials) = mesh.paint else {
            panic!("materials are in use");
        };
        let uses = materials.uses.iter().map(|u| (u.first_face, &*u.name));
        assert!(uses.eq([(0, "a"), (0, "b")]));
    }

    #[test]
    fn detects_colour_range() {
        let with = |last: &str| {
            let text = format!("v 0 0 0 0 0.5 1\nv 1 0 0 1 1 nan\nv 0 1 0 {last}\nf 1 2 3\n");
            parse(&text).unwrap()
        };
        for (last, second, is_noted) in [
            ("1 0 0", [255, 0, 0], false),
            ("inf 0 0", [255, 0, 0], false),
            ("1.000001 0 0", [255, 0, 0], false),
            ("255 128 0", [255, 128, 0], true),
            ("1.5 0 0", [2, 0, 0], true),
        ] {
            let mesh = with(last);
            assert_eq!(mesh.notes.len(), usize::from(is_noted));
            let Paint::Vertices(colours) = &mesh.paint else {
                panic!("every vertex has a colour");
            };
            assert_eq!(colours[2], second, "{last}");
            let first = if is_noted { [0, 1, 1] } else { [0, 128, 255] };
            assert_eq!(colours[0], first);
        }
        assert_note(&with("255 0 0"), "of the file are read as 0 to 255");
    }
}
