//! A file whose every index leads somewhere, and its buffers.

use crate::Location;
use crate::{Result, SceneError};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::validation::{Checked, Validate};
use gltf::json::{self, Root};
use gltf::{Document, Glb, Gltf, buffer};
use host::Folder;
use serde_json::Value;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

pub(super) struct File {
    pub(super) path: PathBuf,
    pub(super) document: Document,
    pub(super) buffers: Vec<Vec<u8>>,
}

/// Extensions that change how surfaces look and not where they are.
const LOOKS: [&str; 5] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
];

/// Extensions that say where surfaces are, and are understood.
const PLACES: [&str; 2] = ["KHR_mesh_quantization", "EXT_mesh_gpu_instancing"];

/// Whether an extension needs no word: it is understood, or changes looks alone.
fn is_understood(name: &str) -> bool {
    PLACES.contains(&name) || LOOKS.iter().any(|start| name.starts_with(start))
}

impl File {
    pub(super) fn wrong(&self, place: Location, cause: impl std::fmt::Display) -> SceneError {
        SceneError::malformed(&self.path, place, cause)
    }

    /// Remarks on extensions that the file does without where they are not understood.
    pub(super) fn remarks(&self) -> Vec<String> {
        let used = self.document.extensions_used();
        used.filter(|name| !is_understood(name))
            .map(|name| format!("the extension {name:?} is not supported and left out"))
            .collect()
    }

    pub(super) fn open(path: &Path, allow_outside: bool) -> Result<Self> {
        let bytes = host::read(path).map_err(|e| SceneError::unreadable(path, e))?;
        let malformed = |cause: &str| SceneError::malformed(path, None, cause);
        check_container(&bytes).map_err(|cause| malformed(&cause))?;
        let read = parse(&bytes).or_else(|e| without_idle_channels(&bytes).ok_or(e));
        let (mut root, blob) = read.map_err(|e| malformed(&format!("not glTF: {e}")))?;
        make_safe(&mut root).map_err(|cause| malformed(&cause))?;
        let document = Document::from_json_without_validation(root);
        let mut file = Self {
            path: path.to_owned(),
            document,
            buffers: Vec::new(),
        };
        file.buffers = file.load(blob, &Folder::of(path, allow_outside))?;
        Ok(file)
    }

    fn load(&self, mut blob: Option<Vec<u8>>, folder: &Folder) -> Result<Vec<Vec<u8>>> {
        let load = |buffer: buffer::Buffer<'_>| {
            let place = ("buffer", buffer.index());
            let data = match buffer.source() {
                buffer::Source::Bin => blob.take().ok_or("the file has no binary chunk".to_owned()),
                buffer::Source::Uri(uri) => fetch(folder, uri),
            };
            let data = data.map_err(|cause| self.wrong(place, cause))?;
            let (found, needed) = (data.len(), buffer.length());
            if found < needed {
                let cause = format!("{needed} bytes are declared, {found} are there");
                return Err(self.wrong(place, cause));
            }
            Ok(data)
        };
        self.document.buffers().map(load).collect()
    }
}

/// The bytes of a base64 data URI or of a file beside this one.
fn fetch(folder: &Folder, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, data) = data.split_once(',').ok_or("a data URI without data")?;
        if !kind.ends_with(";base64") {
            return Err("a data URI that is not base64".to_owned());
        }
        let config =
            GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let decoded = GeneralPurpose::new(&STANDARD, config).decode(data.trim());
        return decoded.map_err(|e| format!("bad base64: {e}"));
    }
    if uri.contains("://") {
        return Err(format!(
            "{uri:?} is not a file beside this one; nothing is fetched from a network"
        ));
    }
    let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
    let read = folder.read(&name);
    read.map_err(|e| format!("cannot read {}: {e}", folder.path(&name).display()))
}

/// A document, and the binary chunk that may come with it.
type Parsed = (Root, Option<Vec<u8>>);

fn parse(bytes: &[u8]) -> Result<Parsed, gltf::Error> {
    let gltf = Gltf::from_slice_without_validation(bytes)?;
    Ok((gltf.document.into_json(), gltf.blob))
}

/// Likewise, less all channels that move no node: the specification has them ignored, and `gltf` 1.4 takes none.
fn without_idle_channels(bytes: &[u8]) -> Option<Parsed> {
    let (text, blob) = match bytes.starts_with(b"glTF") {
        true => Glb::from_slice(bytes).map(|glb| (glb.json, glb.bin)).ok()?,
        false => (bytes.into(), None),
    };
    let mut root: Value = serde_json::from_slice(&text).ok()?;
    for animation in root.get_mut("animations")?.as_array_mut()? {
        let channels = animation.get_mut("channels")?.as_array_mut()?;
        let moves = |target: &Value| target.get("node").is_some();
        channels.retain(|channel| channel.get("target").is_none_or(moves));
    }
    let root = serde_json::from_value(root).ok()?;
    Some((root, blob.map(Cow::into_owned)))
}

/// The `gltf` crate subtracts from a GLB's length before it looks at it.
fn check_container(bytes: &[u8]) -> Result<(), String> {
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let length = bytes.as_chunks().0.get(2).copied();
    match length.map(u32::from_le_bytes) {
        Some(length) if (length as usize) > bytes.len() => {
            let found = bytes.len();
            Err(format!(
                "the file is cut short: {length} bytes are declared, {found} are there"
            ))
        }
        Some(length) if length >= 20 => Ok(()),
        _ => Err("the file is cut short within its header".to_owned()),
    }
}

/// Checks all that later code takes for granted: indices, known values, supported extensions.
fn make_safe(root: &mut Root) -> Result<(), String> {
    root.extensions_required.retain(|name| !is_understood(name));
    if let Some(name) = root.extensions_required.first() {
        return Err(format!(
            "the file requires the extension {name:?}, which is not supported"
        ));
    }
    check_attributes(root)?;
    check_targets(root)?;
    let mut first = None;
    root.validate(root, json::Path::new, &mut |path, error| {
        let path = path().to_string();
        let is_missing = error == json::validation::Error::Missing;
        // An accessor without a view is one of zeros.
        let zeros = path.starts_with("accessors[") && path.ends_with(".bufferView") && is_missing;
        // Those of positions are not used here.
        let bounds = path.ends_with(".min") || path.ends_with(".max");
        if !(zeros || bounds) {
            first.get_or_insert_with(|| format!("{path}: {error}"));
        }
    });
    first.map_or(Ok(()), Err)
}

/// The validation of `gltf` 1.4 panics on these if they lead nowhere.
fn check_attributes(root: &Root) -> Result<(), String> {
    let accessors = root.accessors.len();
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let mut attributes = primitive.attributes.iter();
            if let Some((name, index)) = attributes.find(|a| a.1.value() >= accessors) {
                let (name, index) = (name.to_string(), index.value());
                return Err(format!(
                    "meshes[{m}].primitives[{p}].attributes[{name:?}]: accessor {index} does not exist, there are {accessors}"
                ));
            }
        }
    }
    Ok(())
}

/// The validation of `gltf` 1.4 looks at the samplers of channels and not at their targets.
fn check_targets(root: &Root) -> Result<(), String> {
    let nodes = root.nodes.len();
    for (a, animation) in root.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            let (node, path) = (channel.target.node.value(), &channel.target.path);
            if node >= nodes {
                return Err(format!(
                    "animations[{a}].channels[{c}]: node {node} does not exist, there are {nodes}"
                ));
            }
            if matches!(path, Checked::Invalid) {
                return Err(format!("animations[{a}].channels[{c}]: unknown path"));
            }
        }
    }
    Ok(())
}
