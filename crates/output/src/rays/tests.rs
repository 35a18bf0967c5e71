//! Rays read back as written, and everything else is refused in a sentence.

use super::*;
use std::fs;
use tempfile::TempDir;

fn rays(n: usize) -> Vec<Ray> {
    let ray = |i| {
        let x = i as f32;
        // Those that mean nothing are read, too: they miss.
        let far = if i == 3 { f32::INFINITY } else { 1e-40 };
        Ray::new([x, x + 0.1, x + 0.2], [x + 0.3, -x, far])
    };
    (0..n).map(ray).collect()
}

/// A `.npy` file, version 1, from a header and data.
fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn header(descr: &str, fortran: &str, shape: &str) -> String {
    format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n")
}

fn read(bytes: &[u8]) -> Result<Vec<Ray>, String> {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("rays.npy");
    fs::write(&path, bytes).unwrap();
    let text = |e: OutputError| {
        let text = e.to_string();
        assert!(text.contains("rays.npy") && !text.contains('\n'), "{text}");
        text
    };
    read_rays(&path).map_err(text)
}

fn refused(bytes: &[u8], because: &[&str]) {
    let text = read(bytes).unwrap_err();
    for part in because {
        assert!(text.contains(part), "'{text}' lacks '{part}'");
    }
}

#[test]
fn rays_read_back_as_written() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("rays.npy");
    for mut rays in [rays(0), rays(5), rays(1)] {
        write_rays(&path, rays.len(), rays.iter().copied()).unwrap();
        assert_eq!(read_rays(&path).unwrap(), rays);
        for ray in &mut rays {
            (ray.t_min, ray.t_max) = (0.25, 4.0);
        }
        write_rays(&path, rays.len(), rays.iter().copied()).unwrap();
        assert_eq!(read_rays(&path).unwrap(), rays);
    }
}

#[test]
fn byte_order_and_axis_order_do_not_matter() {
    let want = rays(3);
    let row = |r: &Ray| [r.origin, r.direction].concat();
    let table: Vec<Vec<f32>> = want.iter().map(row).collect();
    let by_column = || (0..6).flat_map(|c| table.iter().map(move |row| row[c]));
    let little: Vec<u8> = by_column().flat_map(f32::to_le_bytes).collect();
    let by_row = table.iter().flatten();
    let big: Vec<u8> = by_row.flat_map(|x| x.to_be_bytes()).collect();
    for (descr, fortran, data) in [("<f4", "True", little), (">f4", "False", big)] {
        let file = npy(&header(descr, fortran, "(3, 6)"), &data);
        assert_eq!(read(&file).unwrap(), want);
    }
}

#[test]
fn another_type_or_shape_is_named() {
    let data = [0; 64];
    for (descr, says) in [("<f8", "'<f8'; convert"), ("<i4", "'<i4'"), ("|O", "found")] {
        let file = npy(&header(descr, "False", "(1, 6)"), &data);
        refused(&file, &["float32", says]);
    }
    let record = "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1, 6)}";
    refused(&npy(record, &data), &["float32"]);
    for shape in ["(6,)", "(2, 7)", "(1, 2, 3)", "()", "(6, 2)"] {
        let file = npy(&header("<f4", "False", shape), &data);
        refused(&file, &["(N, 6) or (N, 8)", shape]);
    }
}

#[test]
fn a_truncated_file_is_refused_wherever_it_ends() {
    let whole = npy(&header("<f4", "False", "(2, 6)"), &[0; 48]);
    assert!(read(&whole).is_ok());
    for end in 0..whole.len() {
        read(&whole[..end]).unwrap_err();
    }
    refused(&whole[..whole.len() - 1], &["truncated", "48", "47"]);
}

#[test]
fn hostile_headers_neither_panic_nor_allocate() {
    let many = format!("({}6)", "99, ".repeat(20));
    for (shape, says) in [
        ("(4294967296, 4294967296)", "too large"),
        (&many, "too large"),
        ("(999999999999, 6)", "truncated"),
    ] {
        refused(&npy(&header("<f4", "False", shape), &[]), &[says]);
    }
    let [deep, deeper] = [4000, 60_000].map(|n| npy(&"(".repeat(n), &[]));
    let other = b"\x93NUMPY\x09\x00\x02\x00\x00\x00{}";
    for file in [&deep[..], &deeper, b"", other, b"ox oy oz\n0 0 0\n"] {
        refused(file, &["not a .npy array"]);
    }
}
