//! An open glTF file: its document, and its buffers, which are loaded on first use.

use super::container::{self, Container};
use super::schema::{Accessor, BufferView, Document, GltfNode, Head, WholeNumber};
use crate::Location;
use crate::folder::Folder;
use crate::{Result, SceneError};
use data_url::DataUrl;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

pub(super) struct GltfFile {
    pub(super) path: PathBuf,
    pub(super) document: Document,
    folder: Folder,
    /// Binary chunk of a `.glb` file.
    binary: Option<Vec<u8>>,
    /// Buffer contents, loaded on first use. A buffer that is never used may be missing.
    buffers: Vec<OnceLock<Result<Vec<u8>, String>>>,
    /// Remarks on the file as a whole.
    pub(super) notes: Vec<String>,
}

/// Supported extensions that change geometry.
const GEOMETRY: [&str; 2] = ["KHR_mesh_quantization", "EXT_mesh_gpu_instancing"];

/// Name prefixes, without the vendor, of extensions that change neither geometry nor motion.
const NEUTRAL: [&str; 15] = [
    "audio_",
    "feature_metadata",
    "instance_features",
    "lights_",
    "materials_",
    "mesh_features",
    "mesh_manifold",
    "node_hoverability",
    "node_selectability",
    "packing_",
    "primitive_outline",
    "structural_metadata",
    "techniques_",
    "texture_",
    "xmp",
];

/// Returns whether an extension is supported or does not affect the result.
fn is_supported_or_neutral(name: &str) -> bool {
    let (_, own_name) = name.split_once('_').unwrap_or_default();
    GEOMETRY.contains(&name) || NEUTRAL.iter().any(|start| own_name.starts_with(start))
}

impl GltfFile {
    pub(super) fn wrong(&self, place: Location, cause: impl fmt::Display) -> SceneError {
        SceneError::malformed(&self.path, place, cause)
    }

    pub(super) fn open(path: &Path, allow_outside: bool) -> Result<Self> {
        let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
        let malformed = |cause: String| SceneError::malformed(path, None, cause);
        let container = Container::split(&bytes).map_err(malformed)?;
        let mut document = parse(container.json).map_err(malformed)?;
        let mut notes = extensions(&document).map_err(malformed)?;
        if document.scenes.is_empty() && document.nodes.is_empty() && !document.meshes.is_empty() {
            place_meshes(&mut document);
            notes.push("the file has no nodes; each mesh is shown once, untransformed".to_owned());
        }
        Ok(Self {
            path: path.to_owned(),
            folder: Folder::of(path, allow_outside),
            binary: container.binary.map(<[u8]>::to_vec),
            buffers: document.buffers.iter().map(|_| OnceLock::new()).collect(),
            document,
            notes,
        })
    }

    /// Returns an item of a list in the document.
    pub(super) fn item<'a, T>(
        &self,
        kind: &str,
        list: &'a [T],
        index: WholeNumber,
    ) -> Result<&'a T> {
        let found = find_item(kind, list, index);
        found.map_err(|cause| SceneError::malformed(&self.path, None, cause))
    }

    pub(super) fn node(&self, index: WholeNumber) -> Result<&GltfNode> {
        self.item("node", &self.document.nodes, index)
    }

    pub(super) fn accessor(&self, index: WholeNumber) -> Result<&Accessor> {
        self.item("accessor", &self.document.accessors, index)
    }

    /// Returns a buffer view and its bytes. The error does not contain the path.
    pub(super) fn view_bytes(&self, index: WholeNumber) -> Result<(&BufferView, &[u8]), String> {
        let view = find_item("buffer view", &self.document.buffer_views, index)?;
        let buffer = self.buffer(view.buffer)?;
        let rest = buffer.get(view.byte_offset.map_or(0, |o| o.0)..);
        let bytes = rest.and_then(|rest| rest.get(..view.byte_length.0));
        let bytes = bytes.ok_or_else(|| {
            let (index, all) = (index.0, buffer.len());
            format!("buffer view {index} ends beyond its buffer of {all} bytes")
        });
        Ok((view, bytes?))
    }

    fn buffer(&self, index: WholeNumber) -> Result<&[u8], String> {
        let buffer = find_item("buffer", &self.buffers, index)?;
        let declared = &self.document.buffers[index.0];
        let found = match (&declared.uri, &self.binary) {
            (None, Some(binary)) if index.0 == 0 => Ok(binary.as_slice()),
            (None, _) => Err("it has no uri and there is no binary chunk for it".to_owned()),
            (Some(uri), _) => {
                let loaded = buffer.get_or_init(|| fetch(&self.folder, uri));
                loaded.as_deref().map_err(String::clone)
            }
        };
        let number = index.0;
        let bytes = found.map_err(|cause| format!("buffer {number}: {cause}"))?;
        let (found, needed) = (bytes.len(), declared.byte_length.0);
        if found < needed {
            return Err(format!(
                "buffer {number}: {needed} bytes are declared, {found} are there"
            ));
        }
        Ok(bytes)
    }
}

/// Returns an item of a list. The error does not contain the path.
fn find_item<'a, T>(kind: &str, list: &'a [T], index: WholeNumber) -> Result<&'a T, String> {
    list.get(index.0).ok_or_else(|| {
        let (index, count) = (index.0, list.len());
        format!("{kind} {index} does not exist, there are {count}")
    })
}

/// Reads a data URI, or a file relative to the folder.
fn fetch(folder: &Folder, uri: &str) -> Result<Vec<u8>, String> {
    if uri.starts_with("data:") {
        let data = DataUrl::process(uri).map_err(|_| "a data URI without data")?;
        let decoded = data.decode_to_vec();
        return decoded
            .map(|(bytes, _)| bytes)
            .map_err(|_| "a data URI with bad base64".to_owned());
    }
    if uri.contains("://") {
        return Err(format!(
            "{uri:?} is not a local file; files are never fetched from a network"
        ));
    }
    let name = file_name(uri);
    let read = folder.read(&name);
    read.map_err(|e| format!("cannot read {}: {e}", folder.path(&name).display()))
}

fn file_name(uri: &str) -> Cow<'_, str> {
    percent_encoding::percent_decode_str(uri).decode_utf8_lossy()
}

/// Returns the names of the files that the buffers of a `.gltf` or `.glb` file refer to. Returns no names if the JSON
/// text is malformed.
pub(crate) fn buffer_files(file: &Path) -> io::Result<Vec<String>> {
    let document = parse(&container::read_json(file)?);
    let buffers = document.map_or_else(|_| Vec::new(), |document| document.buffers);
    let uris = buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
    let files = uris.filter(|uri| !uri.starts_with("data:"));
    Ok(files.map(|uri| file_name(uri).into_owned()).collect())
}

fn read<T: DeserializeOwned>(json: &[u8]) -> Result<T, String> {
    serde_json::from_slice(json).map_err(|e| format!("not glTF: {e}"))
}

/// Parses a document, after checking that its version is supported.
fn parse(json: &[u8]) -> Result<Document, String> {
    let head: Head = read(json)?;
    let asset = head.asset.as_ref();
    let least = asset.and_then(|a| version(a.min_version.as_ref()?));
    let own = asset.and_then(|a| version(a.version.as_ref()?));
    let text = |[major, minor]: [u32; 2]| format!("{major}.{minor}");
    let supported = text(SUPPORTED);
    if let Some(least) = least.filter(|least| *least > SUPPORTED) {
        let least = text(least);
        return Err(format!(
            "the file needs glTF {least}, only {supported} is supported"
        ));
    }
    match own {
        None => Err(format!(
            "there is no asset.version; glTF 1.0 is not supported, only {supported}"
        )),
        Some(own) if own[0] != SUPPORTED[0] => {
            let own = text(own);
            Err(format!("glTF {own} is not supported, only {supported}"))
        }
        // Any file of version 2.x is readable, unless its `minVersion` is above the supported version.
        Some(_) => read(json),
    }
}

/// Major and minor version of the supported glTF specification.
const SUPPORTED: [u32; 2] = [2, 0];

/// Parses a major and a minor version.
fn version(value: &Value) -> Option<[u32; 2]> {
    let text = match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let mut parts = text.split('.');
    let major = parts.next()?.parse().ok()?;
    let minor = parts.next().unwrap_or("0").parse().ok()?;
    Some([major, minor])
}

/// Refuses unsupported extensions that are required, and returns remarks on those that are optional.
fn extensions(document: &Document) -> Result<Vec<String>, String> {
    let mut required = document.extensions_required.iter();
    if let Some(name) = required.find(|name| !is_supported_or_neutral(name)) {
        return Err(format!(
            "the file requires the extension {name:?}, which is not supported"
        ));
    }
    let used = document.extensions_used.iter();
    let used = used.filter(|name| !is_supported_or_neutral(name));
    let remark = |name| format!("the extension {name:?} is not supported and is ignored");
    Ok(used.map(remark).collect())
}

/// Adds one node per mesh. A file without scenes and nodes is a library of meshes (glTF 2.0, 3.5.1).
fn place_meshes(document: &mut Document) {
    let node = |mesh| GltfNode {
        mesh: Some(WholeNumber(mesh)),
        ..GltfNode::default()
    };
    document.nodes = (0..document.meshes.len()).map(node).collect();
}
