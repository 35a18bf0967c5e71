//! Copies of a mesh at one node: `EXT_mesh_gpu_instancing`.

use super::accessor::vectors;
use super::document::File;
use super::rig::unit;
use super::wrong;
use crate::{FileLocation, SceneError};
use glam::{DMat4, DQuat, DVec3};
use gltf::{Accessor, Node};
use serde_json::Value;

const NAME: &str = "EXT_mesh_gpu_instancing";

/// Accessors of the copies' places, each of as many elements.
#[derive(Default)]
struct Attributes<'a> {
    translation: Option<Accessor<'a>>,
    rotation: Option<Accessor<'a>>,
    scale: Option<Accessor<'a>>,
}

impl<'a> Attributes<'a> {
    fn of(file: &'a File, node: &Node<'_>) -> Result<Option<Self>, SceneError> {
        let Some(all) = node.extension_value(NAME).and_then(|e| e.get("attributes")) else {
            return Ok(None);
        };
        let accessor = |name: &str| {
            let Some(value) = all.get(name) else {
                return Ok(None);
            };
            let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
            let found = index.and_then(|i| file.document.accessors().nth(i));
            let cause = || {
                format!(
                    "{NAME}: {name} names no accessor: {}",
                    Value::to_string(value)
                )
            };
            let place = FileLocation::Item("node", node.index());
            found.ok_or_else(|| wrong(file, place, cause())).map(Some)
        };
        Ok(Some(Self {
            translation: accessor("TRANSLATION")?,
            rotation: accessor("ROTATION")?,
            scale: accessor("SCALE")?,
        }))
    }

    /// How many copies there are; one if nothing says so.
    fn count(&self, file: &File, node: &Node<'_>) -> Result<usize, SceneError> {
        let all = [&self.translation, &self.rotation, &self.scale];
        let mut counts = all.into_iter().flatten().map(Accessor::count);
        let count = counts.next().unwrap_or(1);
        if counts.all(|c| c == count) {
            return Ok(count);
        }
        let cause = format!("{NAME}: its attributes differ in their counts");
        Err(wrong(file, FileLocation::Item("node", node.index()), cause))
    }
}

/// How many copies of its mesh a node shows.
pub(super) fn count(file: &File, node: &Node<'_>) -> Result<usize, SceneError> {
    Attributes::of(file, node)?.map_or(Ok(1), |all| all.count(file, node))
}

/// Where each copy stands, seen from the node.
pub(super) fn places(file: &File, node: &Node<'_>) -> Result<Vec<DMat4>, SceneError> {
    let Some(all) = Attributes::of(file, node)? else {
        return Ok(vec![DMat4::IDENTITY]);
    };
    let count = all.count(file, node)?;
    let vector = |accessor: Option<Accessor<'_>>| {
        let read = accessor.map(|a| vectors::<3>(file, &a)).transpose();
        read.map(|v| v.unwrap_or_default())
    };
    let (translations, scales) = (vector(all.translation)?, vector(all.scale)?);
    let rotations = all.rotation.map(|a| vectors::<4>(file, &a)).transpose()?;
    let rotations = rotations.unwrap_or_default();
    let at = |list: &[[f32; 3]], i: usize, rest| {
        list.get(i)
            .map_or(rest, |v| DVec3::from_array(v.map(f64::from)))
    };
    let place = |i: usize| {
        let rotation = rotations.get(i);
        let rotation = rotation.map_or(DQuat::IDENTITY, |q| unit(q.map(f64::from)));
        let (scale, translation) = (
            at(&scales, i, DVec3::ONE),
            at(&translations, i, DVec3::ZERO),
        );
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok((0..count).map(place).collect())
}
