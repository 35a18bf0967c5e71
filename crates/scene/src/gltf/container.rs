//! Container of a glTF file: the JSON text and the binary chunk (glTF 2.0, 4.4).

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Contents of a `.gltf` or `.glb` file.
#[derive(Debug)]
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    /// First chunk of type `BIN`.
    pub(super) binary: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Splits a file into its chunks. The error does not contain the path.
    pub(super) fn split(bytes: &'a [u8]) -> Result<Self, String> {
        let container = match bytes.strip_prefix(b"glTF") {
            Some(_) => Self::split_chunks(bytes)?,
            None => Self {
                json: bytes,
                binary: None,
            },
        };
        check_encoding(container.json)?;
        Ok(container)
    }

    fn split_chunks(bytes: &'a [u8]) -> Result<Self, String> {
        let cut_short = || "the file is cut short within its header".to_owned();
        let version = read_u32(bytes, 4).ok_or_else(cut_short)?;
        if version != 2 {
            return Err(format!("binary glTF {version} is not supported, only 2"));
        }
        let length = read_u32(bytes, 8).ok_or_else(cut_short)?;
        // Bytes after the declared length belong to no chunk.
        let chunks = bytes.get(..length).ok_or_else(|| {
            let found = bytes.len();
            format!("the file is cut short: {length} bytes are declared, {found} are there")
        })?;
        let chunks = split(chunks.get(12..).ok_or_else(cut_short)?)?;
        let mut chunks = chunks.into_iter();
        let Some((b"JSON", json)) = chunks.next() else {
            return Err("the first chunk is not of type JSON".to_owned());
        };
        let binary = chunks.find(|(kind, _)| *kind == b"BIN\0");
        Ok(Self {
            json,
            binary: binary.map(|(_, data)| data),
        })
    }
}

/// Reads the JSON text of a `.gltf` or `.glb` file, but no binary chunk, which may be large.
pub(super) fn read_json(file: &Path) -> io::Result<Vec<u8>> {
    let (mut source, mut bytes) = (File::open(file)?, Vec::new());
    // The headers of a `.glb` file and of its first chunk.
    source.by_ref().take(20).read_to_end(&mut bytes)?;
    let length = read_u32(&bytes, 12).filter(|_| bytes.starts_with(b"glTF"));
    if let Some(length) = length {
        bytes.clear();
        source.take(length as u64).read_to_end(&mut bytes)?;
    } else {
        source.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

fn read_u32(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*word)).ok()
}

/// Type and data of a chunk.
type Chunk<'a> = (&'a [u8; 4], &'a [u8]);

/// Splits a list of chunks. Chunks of unknown types are included, because readers must skip them.
fn split(mut bytes: &[u8]) -> Result<Vec<Chunk<'_>>, String> {
    let mut chunks = Vec::new();
    while let (Some(length), Some((_, rest))) = (read_u32(bytes, 0), bytes.split_at_checked(4)) {
        let Some((kind, rest)) = rest.split_first_chunk() else {
            break;
        };
        let Some((data, rest)) = rest.split_at_checked(length) else {
            let (number, found) = (chunks.len(), rest.len());
            return Err(format!(
                "chunk {number} is cut short: {length} bytes are declared, {found} are there"
            ));
        };
        chunks.push((kind, data));
        bytes = rest;
    }
    Ok(chunks)
}

/// Refuses text that begins with a byte order mark. The message names the mark, since editors do not show it.
fn check_encoding(json: &[u8]) -> Result<(), String> {
    let encoding = match json {
        [0xef, 0xbb, 0xbf, ..] => "UTF-8",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "UTF-16",
        _ => return Ok(()),
    };
    Err(format!(
        "the text begins with a byte order mark of {encoding}; glTF is UTF-8 without one"
    ))
}
