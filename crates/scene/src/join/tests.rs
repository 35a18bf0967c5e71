//! Names with several inputs, and what comes of them.

use super::*;
use std::fs;
use tempfile::TempDir;

const THERE: [&str; 6] = ["a.obj", "b.glb", "a+b.obj", "b@1,2,3", "c+", "demo:hall"];

/// An input, and where it stands with its scale.
type Told<'a> = (&'a str, Option<(Point, f32)>);

fn told(spec: &str) -> Vec<Told<'_>> {
    let exists = |name: &str| THERE.contains(&name);
    let inputs = inputs(spec, &exists).unwrap();
    let place = |p: Placement| (p.at, p.scale);
    let told = inputs.iter().map(|i| (i.spec, i.place.map(place)));
    told.collect()
}

#[test]
fn what_exists_wins_and_else_plus_and_at_part_names() {
    assert_eq!(told("a.obj"), [("a.obj", None)]);
    assert_eq!(told("a.obj+b.glb"), [("a.obj", None), ("b.glb", None)]);
    assert_eq!(told("a+b.obj"), [("a+b.obj", None)]);
    assert_eq!(told("a+b.obj+a.obj"), [("a+b.obj", None), ("a.obj", None)]);
    assert_eq!(told("a.obj+a+b.obj"), [("a.obj", None), ("a+b.obj", None)]);
    assert_eq!(told("c++b.glb"), [("c+", None), ("b.glb", None)]);
    assert_eq!(told("b@1,2,3"), [("b@1,2,3", None)]);
    let at = Some(([1.0, -2.5, 300.0], 1.0));
    assert_eq!(told("a.obj@1,-2.5,3e+2"), [("a.obj", at)]);
    let placed = [("demo:hall", None), ("b.glb", Some(([0.0, 1.0, 0.0], 0.5)))];
    assert_eq!(told("demo:hall+b.glb@0,1,0*0.5"), placed);
    let again = [("b@1,2,3", Some(([4.0, 5.0, 6.0], 1.0))), ("a.obj", None)];
    assert_eq!(told("b@1,2,3@4,5,6+a.obj"), again);
    // What is not there is told of as it was written.
    assert_eq!(told("x.obj+y@z.obj"), [("x.obj", None), ("y@z.obj", None)]);
    assert_eq!(told("a.obj+"), [("a.obj", None), ("", None)]);
}

#[test]
fn a_place_is_three_numbers_and_a_scale() {
    let exists = |name: &str| THERE.contains(&name);
    for bad in [
        "", "1,2", "1,2,3,4", "1,2,x", "1,2,3*0", "1,2,3*-1", "1,2,inf",
    ] {
        let spec = format!("a.obj@{bad}");
        let message = inputs(&spec, &exists).unwrap_err().to_string();
        assert!(
            message.contains("a.obj") && message.contains("@x,y,z"),
            "{message}"
        );
    }
}

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, x: f32| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let text = format!("v {x} -0.0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        fs::write(path, text).unwrap();
    };
    write("still.obj", 5.0);
    write("two/1.obj", 0.0);
    write("two/2.obj", 1.0);
    (1..=3).for_each(|k| write(&format!("three/{k}.obj"), k as f32));
    folder
}

fn open_in(folder: &TempDir, names: &str, options: &Options) -> Result<Scene, String> {
    let root = folder.path().to_str().unwrap();
    let spec: Vec<String> = names.split('+').map(|n| format!("{root}/{n}")).collect();
    crate::open(&spec.join("+"), options).map_err(|e| e.to_string())
}

#[test]
fn inputs_are_joined_in_order_and_a_still_one_is_repeated() {
    let folder = folder();
    let scene = open_in(&folder, "still.obj+two@10,0,0*2", &Options::default()).unwrap();
    let a = &scene.animation;
    assert_eq!(a.triangles(), [[0, 1, 2], [3, 4, 5]]);
    let keys = a.all_keys().unwrap();
    let firsts: Vec<_> = keys.iter().map(|k| [k[0][0], k[3][0], k[5][1]]).collect();
    assert_eq!(firsts, [[5.0, 10.0, 2.0], [5.0, 12.0, 2.0]]);
    assert_eq!((scene.name.as_str(), scene.colours.len()), ("still+two", 2));
    assert_eq!(
        (scene.facts.files.len(), scene.facts.format.as_str()),
        (3, "obj")
    );
    // The file's -0 would be a vertex that moves.
    assert_eq!(a.static_parts().triangles, [true, false]);
}

#[test]
fn inputs_that_move_differently_are_refused_with_both_counts() {
    let folder = folder();
    let message = open_in(&folder, "two+still.obj+three", &Options::default()).unwrap_err();
    for part in ["two has 2", "three 3", "single"] {
        assert!(message.contains(part), "{message}");
    }
    let gone = open_in(&folder, "two+gone.obj", &Options::default()).unwrap_err();
    assert!(gone.contains("gone.obj: no such file"), "{gone}");
}

#[test]
fn a_clip_is_asked_of_inputs_that_have_clips_alone() {
    let folder = folder();
    let options = Options {
        clip: Some("Walk".to_owned()),
        ..Options::default()
    };
    for names in ["still.obj+two", "still.obj", "two", "two/*.obj"] {
        let message = open_in(&folder, names, &options).unwrap_err();
        assert!(message.contains("Walk"), "{names}: {message}");
    }
    assert!(crate::open("demo:twist:100", &options).is_err());
    let message = open_in(&folder, "still.obj+gone.glb", &options).unwrap_err();
    assert!(message.contains("gone.glb: no such file"), "{message}");
}

#[test]
fn times_of_inputs_that_move_are_kept_if_they_are_the_same() {
    let folder = folder();
    let times = |of: &str, second: f64| {
        let text = format!(
            r#"{{"end":9,"frames":[{{"file":"1.obj","time":0}},{{"file":"2.obj","time":{second}}}]}}"#
        );
        fs::write(folder.path().join(of).join("times.json"), text).unwrap();
    };
    times("two", 6.0);
    let alone = open_in(&folder, "still.obj+two", &Options::default()).unwrap();
    assert_eq!(alone.animation.times(), Some(&[0.0, 6.0][..]));
    assert_eq!(alone.animation.end(), 9.0);
    fs::create_dir(folder.path().join("too")).unwrap();
    for file in ["1.obj", "2.obj"] {
        let from = folder.path().join("two").join(file);
        fs::copy(from, folder.path().join("too").join(file)).unwrap();
    }
    let message = open_in(&folder, "two+too", &Options::default()).unwrap_err();
    assert!(message.contains("other times"), "{message}");
    times("too", 6.0);
    open_in(&folder, "two+too", &Options::default()).unwrap();
}

#[test]
fn many_inputs_are_told_apart_in_linear_time() {
    let asked = |count: usize, folder: &str| {
        let names: Vec<String> = (0..count).map(|i| format!("{folder}{i}.obj")).collect();
        let calls = std::cell::Cell::new(0);
        let exists = |name: &str| {
            calls.set(calls.get() + 1);
            names.iter().any(|n| n == name)
        };
        let spec = names.join("+");
        assert_eq!(inputs(&spec, &exists).unwrap().len(), count);
        calls.get()
    };
    for folder in ["", "some/folder/"] {
        let (few, many) = (asked(200, folder), asked(800, folder));
        assert!(many <= 6 * few, "{folder}: {few} calls, then {many}");
    }
}
