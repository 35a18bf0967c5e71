//! Parts of a glTF document that affect geometry and motion.
//!
//! All other properties are skipped, so a file with errors in a texture, a camera or `extras` can still be read.
//! Numbers are read in double precision.

use serde::Deserialize;
use serde::de::{Deserializer, Error};
use serde_json::{Number, Value};
use std::collections::BTreeMap;

/// Non-negative integer. JSON has only one number type, so `3.0` is accepted as 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WholeNumber(pub(super) usize);

impl<'de> Deserialize<'de> for WholeNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// Above this limit, doubles cannot represent every integer.
        const LIMIT: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;
        let number = Number::deserialize(deserializer)?;
        let is_whole = |x: &f64| x.fract() == 0.0 && (0.0..LIMIT).contains(x);
        let float = || Some(number.as_f64().filter(is_whole)? as usize);
        let whole = number.as_u64().and_then(|x| x.try_into().ok());
        let whole = whole.or_else(float).map(Self);
        whole.ok_or_else(|| {
            D::Error::custom(format!("{number} is not a whole number of at least 0"))
        })
    }
}

/// Properties that are read first, to determine whether the document is supported.
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

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<WholeNumber>,
    pub(super) scenes: Vec<GltfScene>,
    pub(super) nodes: Vec<GltfNode>,
    pub(super) meshes: Vec<GltfMesh>,
    pub(super) skins: Vec<GltfSkin>,
    pub(super) materials: Vec<GltfMaterial>,
    pub(super) animations: Vec<Clip>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<GltfBuffer>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfScene {
    pub(super) nodes: Vec<WholeNumber>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfNode {
    pub(super) children: Vec<WholeNumber>,
    pub(super) mesh: Option<WholeNumber>,
    pub(super) skin: Option<WholeNumber>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Option<Vec<f64>>,
    pub(super) extensions: NodeExtensions,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Instancing {
    /// Accessors by attribute name.
    pub(super) attributes: BTreeMap<String, WholeNumber>,
}

#[derive(Deserialize)]
pub(super) struct GltfMesh {
    pub(super) primitives: Vec<GltfPrimitive>,
    pub(super) weights: Option<Vec<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct GltfPrimitive {
    /// Accessors by attribute semantic.
    pub(super) attributes: BTreeMap<String, WholeNumber>,
    pub(super) indices: Option<WholeNumber>,
    pub(super) material: Option<WholeNumber>,
    pub(super) mode: Option<WholeNumber>,
    pub(super) targets: Vec<BTreeMap<String, WholeNumber>>,
}

impl GltfPrimitive {
    /// Returns the accessor of the positions.
    pub(super) fn positions(&self) -> Option<WholeNumber> {
        self.attributes.get(POSITION).copied()
    }

    /// Returns the accessor of position displacements of each morph target.
    pub(super) fn displacements(&self) -> impl Iterator<Item = Option<WholeNumber>> {
        let targets = self.targets.iter();
        targets.map(|target| target.get(POSITION).copied())
    }
}

const POSITION: &str = "POSITION";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct GltfSkin {
    pub(super) inverse_bind_matrices: Option<WholeNumber>,
    pub(super) joints: Vec<WholeNumber>,
}

/// Material in any form. Colours do not affect triangles, so malformed materials are accepted.
#[derive(Deserialize)]
#[serde(transparent)]
pub(super) struct GltfMaterial(Value);

impl GltfMaterial {
    /// Returns the base colour in linear light. The specification's default is white.
    pub(super) fn base_colour(&self) -> [f32; 3] {
        let factor = &self.0["pbrMetallicRoughness"]["baseColorFactor"];
        let factor = <[f32; 4]>::deserialize(factor);
        factor.map_or([1.0; 3], |[r, g, b, _]| [r, g, b])
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Clip {
    pub(super) name: Option<String>,
    pub(super) channels: Vec<GltfChannel>,
    pub(super) samplers: Vec<GltfSampler>,
}

#[derive(Deserialize)]
pub(super) struct GltfChannel {
    pub(super) sampler: WholeNumber,
    pub(super) target: GltfTarget,
}

#[derive(Deserialize)]
pub(super) struct GltfTarget {
    /// Absent if an extension specifies the target.
    pub(super) node: Option<WholeNumber>,
    pub(super) path: String,
}

#[derive(Deserialize)]
pub(super) struct GltfSampler {
    pub(super) input: WholeNumber,
    pub(super) output: WholeNumber,
    pub(super) interpolation: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<WholeNumber>,
    pub(super) byte_offset: Option<WholeNumber>,
    pub(super) component_type: WholeNumber,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: WholeNumber,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub(super) count: WholeNumber,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: WholeNumber,
    pub(super) byte_offset: Option<WholeNumber>,
    pub(super) component_type: WholeNumber,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: WholeNumber,
    pub(super) byte_offset: Option<WholeNumber>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: WholeNumber,
    pub(super) byte_offset: Option<WholeNumber>,
    pub(super) byte_length: WholeNumber,
    pub(super) byte_stride: Option<WholeNumber>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct GltfBuffer {
    pub(super) byte_length: WholeNumber,
    pub(super) uri: Option<String>,
}
