//! Tests with valid and broken files that are built in memory.

use super::*;
use crate::mesh::Paint;
use crate::rounding::Position;
use crate::testing::{Surface, ascii_ply as ascii, assert_note, put, refused, surface};
use std::fs;

const SQUARE: [[f64; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

fn parse(bytes: impl AsRef<[u8]>) -> Result<PolygonMesh> {
    Ok(parse_all(bytes)?.mesh)
}

fn parse_all(bytes: impl AsRef<[u8]>) -> Result<MeshFile> {
    let file = tempfile::Builder::new().suffix(".ply").tempfile().unwrap();
    fs::write(file.path(), bytes).unwrap();
    read(file.path())
}

/// Returns a binary file with double coordinates, an unused property, 16-bit indices, 32-bit list lengths and colours.
fn binary(big: bool, faces: &[(i32, &[i16])]) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\r\nformat binary_{order}_endian 1.0\r\nelement vertex 4\r\nproperty double x\r\nproperty double y\r\n\
         property short quality\r\nproperty double z\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\n\
         element face {}\r\nproperty list int short vertex_indices\r\nend_header\r\n",
        faces.len()
    )
    .into_bytes();
    let mut put = |little: &[u8]| {
        let mut word = little.to_vec();
        if big {
            word.reverse();
        }
        bytes.extend(word);
    };
    for (i, [x, y, z]) in SQUARE.into_iter().enumerate() {
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&7_i16.to_le_bytes());
        put(&z.to_le_bytes());
        [60, 30, 10 * i as u8].into_iter().for_each(|c| put(&[c]));
    }
    for (length, corners) in faces {
        put(&length.to_le_bytes());
        corners.iter().for_each(|v| put(&v.to_le_bytes()));
    }
    bytes
}

#[test]
fn all_encodings_give_same_mesh() {
    let text = ascii(
        "0 0 0\n+1 0 0\n10e-1 .1e1 -.0\r\n 0 1. .0\n",
        "4 0 1 2 3\n3 3 2 0\n",
    );
    let faces: [(i32, &[i16]); 2] = [(4, &[0, 1, 2, 3]), (3, &[3, 2, 0])];
    let (little, big) = (binary(false, &faces), binary(true, &faces));
    for bytes in [text.into_bytes(), little, big] {
        let mesh = parse(&bytes).unwrap();
        assert_eq!(surface(&mesh).triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 0]]);
        assert_eq!(mesh.points.len(), 4);
        assert_eq!(mesh.points[2], [1.0, 1.0, 0.0]);
        if let Paint::Vertices(colours) = mesh.paint {
            assert_eq!(colours[3], [60, 30, 30]);
        }
    }
}

#[test]
fn unused_vertices_are_dropped() {
    let text = ascii("9e9 0 0\n0 0 0\n1 0 0\n9 9 9\n0 1 0\n", "3 4 1 2\n");
    let mesh = parse(text).unwrap();
    let Surface { points, triangles } = surface(&mesh);
    assert_eq!(points, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(triangles, [[2, 0, 1]]);
    assert_eq!(mesh.polygons.vertices, 5);
}

#[test]
fn reads_non_finite_coordinates() {
    let mesh = parse(ascii("nan 0 0\n0 -inf 0\n1 1 0\n", "3 0 1 2\n")).unwrap();
    assert!(!mesh.points[0][0].is_finite() && !mesh.points[1][1].is_finite());
}

#[test]
fn errors_name_line_or_element() {
    let whole = ascii("0 0 0\n1 0 0\n0 1 0\n", "3 0 1 2\n");
    // Each line: old text, new text, part of the message. `;` is a line end in the file.
    let changes = r#"
        3 0 1 2; | 3 0 1 3; | face 0: vertex 3 does not exist
        3 0 1 2; | 4 0 1 2 3; | face 0: vertex 3 does not exist
        3 0 1 2; | 2 0 1; | no triangles
        3 0 1 2; | 4 0 1 2; | line 15: the file is cut short: 1 'face' are declared, 0 are there
        3 0 1 2; | -3 0 1 2; | line 14: bad 'face' 0
        3 0 1 2; | 3 0 1 2.5; | line 14: bad 'face' 0
        3 0 1 2; | 3 0 -1 2; | face 0: a vertex index is negative
        1 0 0; | 1 0 zero; | line 12: bad 'vertex' 1: "zero" is not a number
        1 0 0; | nan .5; | line 14: numbers after the last element; 'vertex' 1 in line 12 is not on a line
        1 0 0; | 1 0; | 'vertex' 1 in line 12 is not on a line of its own
        1 0 0; | 1 0 0 7; | 'vertex' 2 in line 12 is not on a line of its own
        3 0 1 2; | x 0 1 2; | line 14: bad 'face' 0: "x" is not the length of a list
        face 1 | face 3 | line 15: the file is cut short: 3 'face'
        vertex 3 | vertex 18446744073709551615 | cut short
        vertex 3 | vertex 18446744073709551616 | line 4: "element vertex 18446744073709551616" is not understood
        float y | flot y | "property flot y" is not understood in a PLY header
        property float z; | | scalar property 'z'
        element face | element faces | no element 'face' or 'tristrips', only 'vertex', 'faces'
        element face 1 | element face 0;property int a;element face 1 | twice
        vertex_index | corners | vertex_indices
        uchar int | uchar float | whole numbers
        element face 1 | element vertex 1 | twice
        float y | quux y | line 6
        ascii 1.0 | ebcdic 1.0 | line 2
        format ascii 1.0; | | format
        end_header | end | end_header
        3 0 1 2; | | line 14: the file is cut short: 1 'face'
    "#;
    for change in changes.trim().lines() {
        let mut parts = change.split('|').map(str::trim);
        let [from, to, says] = std::array::from_fn(|_| parts.next().unwrap());
        let [from, to] = [from, to].map(|part| part.replace(';', "\n"));
        let broken = whole.replacen(&from, &to, 1);
        assert_ne!(broken, whole, "{from}");
        refused(parse(&broken), &[says]);
    }
    refused(parse("PLY\nend_header\n"), &["line 1"]);
    refused(parse(""), &["end_header"]);
}

#[test]
fn truncated_binary_files_are_rejected() {
    let whole = binary(false, &[(4, &[0, 1, 2, 3]), (3, &[3, 2, 0])]);
    for end in 0..whole.len() {
        refused(parse(&whole[..end]), &[]);
    }
    let (negative, refusal) = ([0, 1, -2], "face 0: a vertex index is negative");
    let too_few = "'face' 0 of 1: List length cannot be negative";
    for (bytes, says) in [
        (whole[..whole.len() - 1].to_vec(), "'face' 1 of 2"),
        (binary(true, &[(-1, &[])]), too_few),
        (binary(true, &[(i32::MAX, &[0, 1, 2])]), "cut short"),
        (binary(false, &[(3, &negative)]), refusal),
    ] {
        refused(parse(bytes), &[says]);
    }
}

#[test]
fn template_read_matches_full_parse() {
    let folder = tempfile::tempdir().unwrap();
    for big in [false, true] {
        // No face uses vertex 2.
        let first = binary(big, &[(3, &[0, 1, 3])]);
        let template = parse_all(&first).unwrap().template.unwrap();
        let kept = [0, 1, 3];
        let mut later = first.clone();
        let z = later.len() - (4 + 6) - 3 - 8;
        later[z..z + 8].copy_from_slice(&[0x3f; 8]);
        let all = parse(&later).unwrap().points;
        let whole = kept.map(|v| all[v as usize]);
        let path = put(&folder, "later.ply", &later);
        let read = template.read(&path, &kept).unwrap().unwrap();
        assert_eq!(read, whole);
        assert_eq!(template.read_again(&path, &kept).unwrap(), whole);
        assert_ne!(read[2], parse(&first).unwrap().points[3]);
        for other in [
            binary(big, &[(3, &[0, 1, 2])]),
            binary(big, &[(3, &[0, 1, 3]), (3, &[0, 1, 3])]),
            later[..later.len() - 1].to_vec(),
            [&later[..], b" "].concat(),
            ascii("0 0 0\n", "3 0 0 0\n").into_bytes(),
        ] {
            let path = put(&folder, "other.ply", other);
            assert!(template.read(&path, &kept).unwrap().is_none());
        }
    }
    let text = parse_all(ascii("0 0 0\n", "3 0 0 0\n")).unwrap();
    assert!(text.template.is_none());
}

#[test]
fn reads_floats_at_any_row_offset() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty uchar red\nproperty float z\n\
        property double w\nproperty float x\nproperty short s\nproperty float y\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";
    let mut bytes = header.as_bytes().to_vec();
    for v in 0..3_u8 {
        let [x, y, z] = [f32::from(v), -0.0, f32::from(v * v)].map(f32::to_le_bytes);
        let (w, s) = (1.5_f64.to_le_bytes(), 7_i16.to_le_bytes());
        bytes.extend([&[9][..], &z, &w, &x, &s, &y].concat());
    }
    bytes.push(3);
    bytes.extend([0_i32, 1, 2].map(i32::to_le_bytes).as_flattened());
    let MeshFile { mesh, template } = parse_all(&bytes).unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), &bytes).unwrap();
    let template = template.unwrap();
    let bits = |points: Vec<Position>| points.concat().into_iter().map(f64::to_bits);
    let kept = [0, 1, 2];
    let read = template.read(file.path(), &kept).unwrap().unwrap();
    let again = template.read_again(file.path(), &kept).unwrap();
    for read in [read, again] {
        assert!(bits(read).eq(bits(mesh.points.clone())));
    }
}

const TRIANGLE: &str = "0 0 0\n1 0 0\n0 1 0\n";

fn only_triangle(bytes: impl AsRef<[u8]>) -> PolygonMesh {
    let mesh = parse(bytes).unwrap();
    let Surface { points, triangles } = surface(&mesh);
    assert_eq!(points, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(triangles, [[0, 1, 2]]);
    mesh
}

#[test]
fn accepts_carriage_returns() {
    let text = ascii(TRIANGLE, "3 0 1 2\n");
    for end in ["\r", "\r\n"] {
        assert!(only_triangle(text.replace('\n', end)).notes.is_empty());
        let wrong = text.replace("1 0 0", "1 0 x").replace('\n', end);
        refused(parse(wrong), &["line 12: bad 'vertex' 1: \"x\""]);
    }
}

/// The data after a header may begin with the byte of a line feed.
#[test]
fn data_may_start_with_line_feed() {
    let text = ascii(TRIANGLE, "3 0 1 2\n");
    let (head, _) = text.split_once("0 0 0").unwrap();
    let head = head.replace("format ascii", "format binary_little_endian");
    let x = f32::from_le_bytes([10, 0, 0, 0x40]);
    for end in ["\n", "\r\n", "\r"] {
        let mut bytes = head.replace('\n', end).into_bytes();
        for point in [[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
            bytes.extend(point.map(f32::to_le_bytes).as_flattened());
        }
        bytes.push(3);
        bytes.extend([0_i32, 1, 2].map(i32::to_le_bytes).as_flattened());
        let mesh = parse(&bytes).unwrap();
        assert_eq!(mesh.points[0], [x.into(), 0.0, 0.0], "{end:?}");
        assert!(mesh.notes.is_empty(), "{:?}", mesh.notes);
    }
}

#[test]
fn accepts_blanks_in_header_lines() {
    let text = ascii(TRIANGLE, "3 0 1 2\n");
    let (head, body) = text.split_at(text.find("0 0 0").unwrap());
    for head in [
        head.replace("\n", "\n\n").replacen("\n\n", "\n", 1),
        head.replace("\n", "  \n\t "),
        head.replace(' ', " \t "),
        head.replace("made here", ""),
        head.replace("comment made here", "obj_info"),
        format!("\u{feff}{head}"),
    ] {
        // Blanks after the last header line belong to the body.
        only_triangle(format!("{head}{body}"));
    }
}

#[test]
fn accepts_any_property_names() {
    let names = [
        "scalar_#2",
        "a.b",
        "1st",
        "c2c(abs)",
        "gr\u{f6}\u{df}e",
        "-",
        "nx",
        "nx",
        "x",
    ];
    let latin = |text: &str| text.chars().map(|c| c as u8).collect::<Vec<u8>>();
    let text = ascii(
        &TRIANGLE.replace('\n', " 7 7 7 7 7 7 7 7 7\n"),
        "3 0 1 2 9\n",
    );
    let declared: String = names
        .map(|name| format!("property float {name}\n"))
        .concat();
    let text = text.replace("element face", &format!("{declared}element face"));
    let text = text.replace(
        "end_header",
        "property uchar \u{e9}\nelement 2\u{e9} 0\nproperty int a\nelement 2\u{e9} 1\nend_header",
    );
    only_triangle(&text);
    only_triangle(latin(&text));
}

#[test]
fn ascii_numbers_ignore_line_breaks() {
    let faces = "3 0 1 2\n";
    for body in [
        format!("\n{TRIANGLE}\n\n{faces}\n"),
        format!("0 0\n0\n1\n0 0\n0 1 0\n{faces}"),
        format!("0 0 0 1 0 0 0 1 0 {faces}"),
        "0 0 0 1 0\n0 0 1 0 3\n0 1\n2".to_owned(),
        "0 0 0\n1 0 0\n0 1 0\n3\n0\n1\n2\n".to_owned(),
    ] {
        let text = ascii(TRIANGLE, faces);
        let head = &text[..text.find("0 0 0").unwrap()];
        assert!(only_triangle(format!("{head}{body}")).notes.is_empty());
    }
}

#[test]
fn faces_below_three_vertices_are_skipped() {
    for (faces, says) in [
        (
            "3 0 1 2\n2 0 1\n",
            "skipped 1 faces of fewer than 3 vertices, the first in face 1",
        ),
        (
            "0\n3 0 1 2\n1 9\n2 0 -1\n",
            "skipped 3 faces of fewer than 3 vertices, the first in face 0",
        ),
    ] {
        assert_note(&only_triangle(ascii(TRIANGLE, faces)), says);
    }
    let coloured = ascii(TRIANGLE, "0 1 2 3\n3 0 1 2 9 8 7\n").replace(
        "end_header",
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header",
    );
    let mesh = only_triangle(coloured);
    assert!(matches!(mesh.paint, Paint::Faces(colours) if colours == [[9, 8, 7]]));
    let binary = parse(binary(false, &[(2, &[0, 1]), (3, &[3, 2, 0]), (0, &[])])).unwrap();
    assert_note(&binary, "skipped 2 faces");
    refused(
        parse(ascii(TRIANGLE, "2 0 1\n3 0 1 7\n")),
        &["face 1: vertex 7"],
    );
}

fn strips(lists: &str) -> String {
    let points = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n";
    ascii(points, lists).replace("element face", "element tristrips")
}

#[test]
fn strips_have_consistent_orientation() {
    let of = |lists: &str| surface(&parse(strips(lists)).unwrap()).triangles;
    assert_eq!(of("4 0 1 2 3\n"), [[0, 1, 2], [2, 1, 3]]);
    let all = [[0, 1, 2], [2, 1, 3], [2, 3, 4]];
    assert_eq!(of("5 0 1 2 3 4\n"), all);
    // The orientation restarts after -1 and in every list. Triangles that connect strips are kept.
    assert_eq!(
        of("8 0 1 2 -1 1 3 2 4\n4 0 0 1 2\n"),
        [[0, 1, 2], [1, 3, 2], [2, 3, 4], [0, 0, 1], [1, 0, 2]]
    );
}

#[test]
fn strips_are_validated_like_faces() {
    let mesh = parse(strips("9 -1 0 1 -1 -1 0 1 2 -1\n")).unwrap();
    assert_eq!(surface(&mesh).triangles, [[0, 1, 2]]);
    assert_note(
        &mesh,
        "skipped 1 faces of fewer than 3 vertices, the first in tristrips 0",
    );
    for (lists, says) in [
        ("3 0 1 5\n", "tristrips 0: vertex 5 does not exist"),
        ("3 0 1 -2\n", "tristrips 0: a vertex index is negative"),
        ("2 0 1\n", "no triangles"),
    ] {
        refused(parse(strips(lists)), &[says]);
    }
    let float = strips("3 0 1 2\n").replace("uchar int", "uchar float");
    refused(
        parse(float),
        &["'tristrips' are not declared as whole numbers"],
    );
}

#[test]
fn strips_and_faces_keep_file_order() {
    let text = strips("3 2 1 3\n").replace(
        "end_header",
        "element face 1\nproperty list uchar short vertex_indices\nend_header",
    );
    let mesh = parse(text + "3 0 1 2\n").unwrap();
    assert_eq!(surface(&mesh).triangles, [[2, 1, 3], [0, 1, 2]]);
}

#[test]
fn detects_float_colour_range() {
    let with = |scale: f32| {
        let colour = [1.0, 0.5, 0.0]
            .map(|c: f32| (c * scale).to_string())
            .join(" ");
        let points = TRIANGLE.replace('\n', &format!(" {colour}\n"));
        let declared = ["red", "green", "blue"].map(|c| format!("property float {c}\n"));
        let text = ascii(&points, "3 0 1 2\n");
        text.replace("element face", &(declared.concat() + "element face"))
    };
    for (scale, notes) in [(1.0, 0), (255.0, 1)] {
        let mesh = only_triangle(with(scale));
        assert_eq!(mesh.notes.len(), notes);
        assert!(matches!(mesh.paint, Paint::Vertices(c) if c == [[255, 128, 0]; 3]));
    }
}
