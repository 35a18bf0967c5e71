//! Wavefront OBJ: `tobj` reads numbers, fans faces and reads materials.
//!
//! `tobj` names no line, counts the vertices of each group anew and takes lines (`l`) for faces. What it does not like about
//! some of them it leaves out. So [`Statements`] goes through the text first, refuses what is wrong with the line it is in, and
//! hands on plain vertices and faces only.

mod materials;

use crate::mesh::{Mesh, Paint, Topology, from_display};
use crate::stream::check_mesh;
use crate::{Result, Rgb, SceneError};
pub(crate) use materials::paint;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

pub(crate) fn read(path: &Path) -> Result<Mesh> {
    let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
    check_memory(path, &bytes)?;
    let found = Statements::scan(&bytes)
        .map_err(|(line, cause)| SceneError::malformed(path, ("line", line), cause))?;
    let failed = |e: &dyn std::fmt::Display| SceneError::malformed(path, None, e);
    let options = tobj::LoadOptions {
        triangulate: true,
        ..tobj::LoadOptions::default()
    };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut found.plain.as_bytes(), &options, no_materials)
        .map_err(|e| failed(&e))?;
    // Without groups and materials in its text, tobj makes one model, or none without faces.
    let mesh = models.into_iter().next().map(|m| m.mesh);
    let mesh = mesh.unwrap_or_default();
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
        pattern: None,
    })
}

#[derive(Debug, Default)]
struct Statements {
    /// Vertices and faces alone, faces by absolute position index: text for `tobj`.
    plain: String,
    /// Vertices and faces as numbered in the file, from 0.
    topology: Topology,
    /// One for each vertex, if every vertex has one.
    colours: Vec<Rgb>,
    libraries: Vec<String>,
    /// (First face, name) of each material in use.
    uses: Vec<(usize, String)>,
    face_lines: Vec<usize>,
    /// Statements that are skipped: how many there are, and the line of the first.
    skipped: BTreeMap<String, (usize, usize)>,
    /// Whether the last line has no end.
    open_end: bool,
}

/// In which line something is wrong, and what.
type Wrong = (usize, String);

impl Statements {
    fn scan(bytes: &[u8]) -> Result<Self, Wrong> {
        let mut found = Self {
            open_end: !bytes.ends_with(b"\n") && !bytes.is_empty(),
            ..Self::default()
        };
        let text = String::from_utf8_lossy(bytes);
        let mut lines = text.trim_start_matches('\u{feff}').split('\n').enumerate();
        let mut joined = String::new();
        while let Some((index, mut line)) = lines.next() {
            // A backslash at the end goes on in the next line.
            if line.trim_end().ends_with('\\') {
                joined.clear();
                while let Some(part) = line.trim_end().strip_suffix('\\') {
                    joined.push_str(part);
                    joined.push(' ');
                    line = lines.next().map_or("", |(_, next)| next);
                }
                joined.push_str(line);
                line = &joined;
            }
            let number = index + 1;
            found.statement(number, line).map_err(|e| (number, e))?;
        }
        found.check_references()?;
        Ok(found)
    }

    fn statement(&mut self, line: usize, text: &str) -> Result<(), String> {
        let text = text.trim();
        let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let data = rest.split('#').next().unwrap_or_default();
        match word {
            "v" => self.vertex(data)?,
            "f" | "fo" => self.face(line, data)?,
            "usemtl" => {
                let first_face = self.face_lines.len();
                self.uses.push((first_face, rest.trim().to_owned()));
            }
            "mtllib" => self.libraries.push(rest.trim().to_owned()),
            // These have no say in which triangles there are.
            "" | "vt" | "vn" | "vp" | "g" | "o" | "s" | "mg" | "usemap" | "maplib" | "lod"
            | "shadow_obj" | "trace_obj" => {}
            word if word.starts_with('#') => {}
            word => {
                let word = word.chars().take(24).collect();
                self.skipped.entry(word).or_insert((0, line)).0 += 1;
            }
        }
        Ok(())
    }

    /// `x y z`, `x y z w`, `x y z r g b` or `x y z r g b a`.
    fn vertex(&mut self, data: &str) -> Result<(), String> {
        let words = || data.split_ascii_whitespace();
        let mut numbers = [0.0_f32; 7];
        let mut count = 0;
        for word in words() {
            let number = word.parse();
            let number = number.map_err(|_| format!("{word:?} is not a number"))?;
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        if !matches!(count, 3 | 4 | 6 | 7) {
            return Err(format!(
                "a vertex of {count} numbers, where 3 are expected, or 4 with w, or 6 with a colour"
            ));
        }
        if count == 4 && numbers[3] == 0.0 {
            return Err("w is 0, which leaves no place for the vertex".to_owned());
        }
        if count > 4 && self.colours.len() == self.topology.vertices {
            let colour = from_display([numbers[3], numbers[4], numbers[5]]);
            self.colours.push(colour);
        }
        self.topology.vertices += 1;
        self.plain.push('v');
        for word in words().take(if count == 4 { 4 } else { 3 }) {
            self.plain.push(' ');
            self.plain.push_str(word);
        }
        self.plain.push('\n');
        Ok(())
    }

    fn face(&mut self, line: usize, data: &str) -> Result<(), String> {
        let count = data.split_ascii_whitespace().count();
        if count < 3 {
            return Err(format!(
                "a face of {count} vertices, where 3 or more are expected"
            ));
        }
        let vertices = self.topology.vertices;
        let words = data.split_ascii_whitespace();
        let corners = words.map(|word| corner(word, vertices));
        let corners = corners.collect::<Result<Vec<u32>, String>>()?;
        self.plain.push('f');
        for &vertex in &corners {
            // Writing to a string cannot fail.
            let _ = write!(self.plain, " {}", u64::from(vertex) + 1);
        }
        self.plain.push('\n');
        self.topology.push(corners);
        self.face_lines.push(line);
        Ok(())
    }

    /// A face may come before its vertices, so this waits for the end of the file.
    fn check_references(&self) -> Result<(), Wrong> {
        let vertices = self.topology.vertices;
        for (&line, corners) in self.face_lines.iter().zip(self.topology.faces()) {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                let vertex = u64::from(vertex) + 1;
                let cause = format!("vertex {vertex} does not exist, there are {vertices}");
                return Err((line, cause));
            }
        }
        Ok(())
    }

    fn notes(&self, path: &Path) -> Vec<String> {
        let file = path.display();
        let told = |(word, (count, line)): (&String, &(usize, usize))| {
            format!("{file}: skipped {count} '{word}' statements, the first in line {line}")
        };
        let mut notes: Vec<_> = self.skipped.iter().map(told).collect();
        if self.open_end {
            notes.push(format!(
                "{file}: the last line has no end; the file may be cut short"
            ));
        }
        notes
    }
}

/// The vertex, from 0, that `v`, `v/vt`, `v//vn` or `v/vt/vn` names; negative numbers count back from the last of `vertices`.
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

/// Refuses a text whose mesh memory does not hold: a copy for `tobj`, its lists, and ours.
fn check_memory(path: &Path, text: &[u8]) -> Result<()> {
    const VERTEX: usize = 60;
    const FACE: usize = 24;
    const TRIANGLE: usize = 48;
    /// What `tobj` keeps of a face, in a list that grows by doubling.
    const LISTED: usize = 104;
    let ([mut vertices, mut faces], mut triangles) = ([0_usize; 2], 0);
    for line in text.split(|&b| b == b'\n') {
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => vertices += 1,
            Some(b"f") => {
                faces += 1;
                triangles += words.count().saturating_sub(2);
            }
            _ => {}
        }
    }
    let listed = faces.next_power_of_two() * LISTED;
    let need = text.len() + vertices * VERTEX + faces * FACE + listed + triangles * TRIANGLE;
    check_mesh(path, [vertices, faces], need)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::refused;
    use std::fs;

    fn parse(text: &str) -> Result<Mesh> {
        let file = tempfile::Builder::new().suffix(".obj").tempfile().unwrap();
        fs::write(file.path(), text).unwrap();
        read(file.path())
    }

    #[test]
    fn triangles_come_in_file_order_whatever_groups_and_lines_say() {
        let mesh = parse(
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\ng b\nusemtl m\nf 1 2 3 4\n\
             g a\nl 1 2 3\nf -1/1/1 -2/1/1 -4//1 # a comment\nusemtl n\nf 2 \\\n 3 4\n",
        )
        .unwrap();
        let at = |v: u32| [0, 1].map(|axis| mesh.points[v as usize][axis]);
        let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let found: Vec<_> = mesh.triangles.iter().map(|t| t.map(at)).collect();
        assert_eq!(found, [[a, b, c], [a, c, d], [d, c, a], [b, c, d]]);
        let is_told = |n: &String| n.contains("line 11") && n.contains("'l'");
        assert!(mesh.notes.iter().any(is_told), "{:?}", mesh.notes);
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
            refused(parse(&format!("{head}{text}")), &[says]);
        }
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
