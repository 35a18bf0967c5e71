//! What glTF allows beyond whole accessors of floats.

use super::*;

const NORMALIZED: &str = r#","normalized":true"#;

/// A static triangle whose positions are `accessor`, with more JSON.
fn still(positions: usize, more: &str) -> String {
    let attributes = format!(r#"{{"POSITION":{positions}}}"#);
    format!(
        r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{attributes}}}]}}]{more}"#
    )
}

fn corners(scene: &Scene) -> Vec<Point> {
    scene.animation.first().to_vec()
}

#[test]
fn an_accessor_without_a_view_is_zeros() {
    let mut bin = Bin::default();
    let declared = r#"{"componentType":5126,"type":"VEC3","count":3}"#;
    bin.accessors.push(declared.to_owned());
    bin.view(&[1, 2]);
    let scene = read(&bin, &still(0, "")).unwrap();
    assert_eq!(corners(&scene), [[0.0; 3]; 3]);
}

#[test]
fn quantized_positions_are_whole_numbers_or_parts_of_one() {
    let name = r#"["KHR_mesh_quantization"]"#;
    let required = format!(r#","extensionsUsed":{name},"extensionsRequired":{name}"#);
    let bytes = vec![0, 0, 0, 127, 0, 0, 0, 0x81, 0];
    let shorts = [0_i16, 0, 0, 32767, 0, 0, 0, -32767, 0];
    let shorts = shorts.map(i16::to_le_bytes).concat();
    let whole = |kind, x, y| (kind, "", [x, y]);
    let part = |kind, x: f32, y: f32, most: f32| (kind, NORMALIZED, [x / most, y / most]);
    for (component, more, [x, y]) in [
        whole(5120, 127.0, -127.0),
        part(5120, 127.0, -127.0, 127.0),
        whole(5121, 127.0, 129.0),
        part(5121, 127.0, 129.0, 255.0),
        whole(5122, 32767.0, -32767.0),
        part(5122, 32767.0, -32767.0, 32767.0),
        whole(5123, 32767.0, 32769.0),
        part(5123, 32767.0, 32769.0, 65535.0),
    ] {
        let data = if component < 5122 { &bytes } else { &shorts };
        let mut bin = Bin::default();
        let positions = bin.add(data, component, "VEC3", 3, more);
        let scene = read(&bin, &still(positions, &required)).unwrap();
        assert_eq!(corners(&scene), [[0.0; 3], [x, 0.0, 0.0], [0.0, y, 0.0]]);
        assert!(scene.facts.notes.is_empty(), "{:?}", scene.facts.notes);
    }
}

#[test]
fn instances_are_drawn_each_in_its_place() {
    let mut bin = Bin::default();
    let positions = bin.floats(&CORNERS, "VEC3");
    let places = bin.floats(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0], "VEC3");
    let scales = bin.floats(&[1.0, 1.0, 1.0, 2.0, 2.0, 2.0], "VEC3");
    let required = r#","extensionsRequired":["EXT_mesh_gpu_instancing"]"#;
    let with = |attributes: &str| {
        let instances = format!(
            r#""mesh":0,"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{{attributes}}}}}}}}}]"#
        );
        let rest = still(positions, required).replacen(r#""mesh":0}]"#, &instances, 1);
        read(&bin, &rest)
    };
    let scene = with(&format!(r#""TRANSLATION":{places},"SCALE":{scales}"#)).unwrap();
    assert_eq!(scene.animation.triangle_count(), 2);
    assert_eq!(corners(&scene)[1], [1.0, 0.0, 0.0]);
    assert_eq!(corners(&scene)[4], [7.0, 0.0, 0.0]);
    let uneven = format!(r#""TRANSLATION":{places},"SCALE":{positions}"#);
    for (attributes, says) in [
        (r#""TRANSLATION":99"#, "TRANSLATION names no accessor: 99"),
        (uneven.as_str(), "differ in their counts"),
    ] {
        let message = with(attributes).unwrap_err();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn extensions_that_are_not_supported_are_named() {
    let mut bin = Bin::default();
    let positions = bin.floats(&CORNERS, "VEC3");
    for name in ["KHR_draco_mesh_compression", "EXT_meshopt_compression"] {
        let used = still(positions, &format!(r#","extensionsUsed":["{name}"]"#));
        let notes = read(&bin, &used).unwrap().facts.notes;
        assert!(notes[0].contains(name), "{notes:?}");
        let required = used.replace("extensionsUsed", "extensionsRequired");
        let message = read(&bin, &required).unwrap_err();
        let says = format!("requires the extension {name:?}");
        assert!(message.contains(&says), "{message}");
    }
}
