//! Parts of a glTF document that affect geometry and motion.
//!
//! All other properties are skipped, so errors in a texture, a camera or an `extras` do not fail the file. Numbers are
//! read in double precision.

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use serde::{Deserialize, de};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;

/// Non-negative integer. JSON has only one number type, so `3.0` is accepted as 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Whole(pub(super) usize);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WholeVisitor).map(Self)
    }
}

struct WholeVisitor;

impl Visitor<'_> for WholeVisitor {
    type Value = usize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a whole number of at least 0")
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<usize, E> {
        usize::try_from(value).map_err(|_| Error::invalid_value(Unexpected::Unsigned(value), &self))
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<usize, E> {
        /// Above this limit, doubles cannot represent every integer.
        const LIMIT: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;
        if value.fract() == 0.0 && (0.0..LIMIT).contains(&value) {
            self.visit_u64(value as u64)
        } else {
            Err(Error::invalid_value(Unexpected::Float(value), &self))
        }
    }
}

/// Properties that determine whether the rest can be read.
#[derive(Deserialize)]
pub(super) struct Head {
    pub(super) asset: Option<Asset>,
}

/// Versions of the file. They are strings, but some exporters write numbers.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub(super) version: Option<Value>,
    pub(super) min_version: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    #[serde(default)]
    pub(super) extensions_used: Vec<String>,
    #[serde(default)]
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<Whole>,
    #[serde(default)]
    pub(super) scenes: Vec<Scene>,
    #[serde(default)]
    pub(super) nodes: Vec<Node>,
    #[serde(default)]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default)]
    pub(super) skins: Vec<Skin>,
    #[serde(default)]
    pub(super) materials: Vec<Material>,
    #[serde(default)]
    pub(super) animations: Vec<Animation>,
    #[serde(default)]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default)]
    pub(super) buffer_views: Vec<BufferView>,
    #[serde(default)]
    pub(super) buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<Whole>,
}

#[derive(Default, Deserialize)]
pub(super) struct Node {
    #[serde(default)]
    pub(super) children: Vec<Whole>,
    pub(super) mesh: Option<Whole>,
    pub(super) skin: Option<Whole>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Option<Vec<f64>>,
    #[serde(default)]
    pub(super) extensions: NodeExtensions,
}

#[derive(Default, Deserialize)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
}

#[derive(Deserialize)]
pub(super) struct Instancing {
    /// Accessors by attribute name.
    #[serde(default)]
    pub(super) attributes: BTreeMap<String, Whole>,
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Vec<f64>>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    /// Accessors by attribute semantic.
    #[serde(default)]
    pub(super) attributes: BTreeMap<String, Whole>,
    pub(super) indices: Option<Whole>,
    pub(super) material: Option<Whole>,
    pub(super) mode: Option<Whole>,
    #[serde(default)]
    pub(super) targets: Vec<BTreeMap<String, Whole>>,
}

impl Primitive {
    /// Returns the accessor of the positions.
    pub(super) fn positions(&self) -> Option<Whole> {
        self.attributes.get(POSITION).copied()
    }

    /// Returns the accessor of position displacements of each morph target.
    pub(super) fn displacements(&self) -> impl Iterator<Item = Option<Whole>> {
        let targets = self.targets.iter();
        targets.map(|target| target.get(POSITION).copied())
    }
}

const POSITION: &str = "POSITION";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) inverse_bind_matrices: Option<Whole>,
    pub(super) joints: Vec<Whole>,
}

/// Material in any form. Colours do not affect triangles, so malformed materials are accepted.
#[derive(Deserialize)]
#[serde(transparent)]
pub(super) struct Material(Value);

impl Material {
    /// Returns the base colour in linear light. The specification's default is white.
    pub(super) fn base_colour(&self) -> [f32; 3] {
        let factor = &self.0["pbrMetallicRoughness"]["baseColorFactor"];
        let factor = <[f32; 4]>::deserialize(factor);
        factor.map_or([1.0; 3], |[r, g, b, _]| [r, g, b])
    }
}

#[derive(Deserialize)]
pub(super) struct Animation {
    pub(super) name: Option<String>,
    #[serde(default)]
    pub(super) channels: Vec<Channel>,
    #[serde(default)]
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
pub(super) struct Channel {
    pub(super) sampler: Whole,
    pub(super) target: Target,
}

#[derive(Deserialize)]
pub(super) struct Target {
    /// Absent if an extension specifies the target.
    pub(super) node: Option<Whole>,
    pub(super) path: String,
}

#[derive(Deserialize)]
pub(super) struct Sampler {
    pub(super) input: Whole,
    pub(super) output: Whole,
    pub(super) interpolation: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<Whole>,
    pub(super) byte_offset: Option<Whole>,
    pub(super) component_type: Whole,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: Whole,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub(super) count: Whole,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: Whole,
    pub(super) byte_offset: Option<Whole>,
    pub(super) component_type: Whole,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: Whole,
    pub(super) byte_offset: Option<Whole>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: Whole,
    pub(super) byte_offset: Option<Whole>,
    pub(super) byte_length: Whole,
    pub(super) byte_stride: Option<Whole>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) byte_length: Whole,
    pub(super) uri: Option<String>,
}
