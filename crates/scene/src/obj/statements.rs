//! The statements of an OBJ file, each checked where its line is known.

use crate::Rgb;
use crate::colour::from_display;
use crate::mesh::Topology;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// What a file says.
#[derive(Debug, Default)]
pub(super) struct Statements {
    /// Vertices and faces alone, faces by absolute position index: text for `tobj`.
    pub(super) plain: String,
    /// Vertices and faces as numbered in the file, from 0.
    pub(super) topology: Topology,
    /// One for each vertex, if every vertex has one.
    pub(super) colours: Vec<Rgb>,
    /// Names of material libraries.
    pub(super) libraries: Vec<String>,
    /// (First face, name) of each material in use.
    pub(super) uses: Vec<(usize, String)>,
    /// Line of each face.
    face_lines: Vec<usize>,
    /// Statements that are skipped: how many there are, and the line of the first.
    skipped: BTreeMap<String, (usize, usize)>,
    /// Whether the last line has no end.
    open_end: bool,
}

/// What is wrong, and in which line.
#[derive(Debug)]
pub(super) struct Wrong {
    pub(super) line: usize,
    pub(super) cause: String,
}

impl Statements {
    /// Goes through the whole text.
    pub(super) fn scan(bytes: &[u8]) -> Result<Self, Wrong> {
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
            let wrong = |cause| Wrong {
                line: index + 1,
                cause,
            };
            found.statement(index + 1, line).map_err(wrong)?;
        }
        found.check_references()?;
        Ok(found)
    }

    fn statement(&mut self, line: usize, text: &str) -> Result<(), String> {
        let text = text.trim();
        let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let data = rest.split('#').next().unwrap_or_default();
        match word {
            "v" => self.vertex(data),
            "f" | "fo" => self.face(line, data),
            "usemtl" => {
                let name = rest.trim().to_owned();
                self.uses.push((self.face_lines.len(), name));
                Ok(())
            }
            "mtllib" => {
                self.libraries.push(rest.trim().to_owned());
                Ok(())
            }
            // These have no say in which triangles there are.
            "" | "vt" | "vn" | "vp" | "g" | "o" | "s" | "mg" | "usemap" | "maplib" | "lod"
            | "shadow_obj" | "trace_obj" => Ok(()),
            word if word.starts_with('#') => Ok(()),
            word => {
                let word = word.chars().take(24).collect();
                self.skipped.entry(word).or_insert((0, line)).0 += 1;
                Ok(())
            }
        }
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
                return Err(Wrong { line, cause });
            }
        }
        Ok(())
    }

    /// Remarks about what was left out.
    pub(super) fn notes(&self, path: &Path) -> Vec<String> {
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
