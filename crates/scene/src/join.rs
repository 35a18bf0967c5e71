//! Joins several inputs into one scene: `hall.obj+figure.glb@2,0,-1*0.5`.
//!
//! The triangles are in the order of the inputs. All moving inputs must have the same number of key frames. The key
//! frame of a static input is repeated.

use crate::mesh::joined_triangles;
use crate::paging::{KeySize, check_keys, within};
use crate::paths::{decode_path, exists};
use crate::rounding::{Position, RoundedPosition, remarks};
use crate::source::{is_gltf_input, open_one, refuse_clip};
use crate::{Facts, Result, Scene, SceneError, SceneOptions, paging};
use geom::Point;
use std::sync::Arc;

/// Separator between inputs.
const AND: char = '+';
/// Separator between an input and its placement.
const AT: char = '@';

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Input<'a> {
    /// Name of the input without its placement.
    pub(crate) spec: &'a str,
    /// `None` if the input has no placement.
    pub(crate) place: Option<InputPlacement>,
}

/// Maps a point `p` to `p * scale + at`. Each operation rounds once. The identity also maps -0 to +0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct InputPlacement {
    at: Position,
    scale: f32,
}

impl InputPlacement {
    const IDENTITY: Self = Self {
        at: [0.0; 3],
        scale: 1.0,
    };

    /// Returns the transformed point in double precision.
    fn put_exactly(self, p: Position) -> Position {
        std::array::from_fn(|i| p[i] * f64::from(self.scale) + self.at[i])
    }

    fn put(self, p: Point) -> Point {
        std::array::from_fn(|i| p[i] * self.scale + self.at[i] as f32)
    }
}

/// Splits the name of a scene into inputs. A name that `exists` as a whole is one input, whatever characters it
/// contains. Returns an error if an input has an invalid placement or no name.
pub(crate) fn inputs<'a>(all: &'a str, exists: &dyn Fn(&str) -> bool) -> Result<Vec<Input<'a>>> {
    let (mut inputs, mut rest) = (Vec::new(), Some(all));
    while let Some(spec) = rest {
        let (first, after) = first_input(spec, exists);
        let input = input(first, exists)?;
        if input.spec.is_empty() && !all.is_empty() {
            let cause = "an input of the joined scene has no name";
            return Err(SceneError::unusable(all, cause));
        }
        inputs.push(input);
        rest = after;
    }
    Ok(inputs)
}

/// Splits off the first input, and returns it and the text after its `+`. The first input is the longest prefix that
/// names an existing input and is followed by `+` or nothing. If there is none, the text is split at the first `+`.
///
/// Of the prefixes before a `+`, only those of at most `LONGEST` bytes are tested. Without this limit, a long list
/// of inputs would take quadratic time.
fn first_input<'a>(spec: &'a str, exists: &dyn Fn(&str) -> bool) -> (&'a str, Option<&'a str>) {
    const LONGEST: usize = 1024;
    let all = spec.match_indices(AND).map(|(at, _)| at);
    let cuts: Vec<usize> = all.take_while(|&at| at <= LONGEST).collect();
    let ends = [spec.len()].into_iter().chain(cuts.into_iter().rev());
    let names = |end: &usize| input(&spec[..*end], exists).is_ok_and(|i| exists(i.spec));
    let end = ends.into_iter().find(names);
    let end = end.or_else(|| spec.find(AND)).unwrap_or(spec.len());
    (&spec[..end], spec.get(end + 1..))
}

/// Splits a placement off an input. A text that names an existing input has no placement. An invalid placement is an
/// error only if the name before it exists.
fn input<'a>(text: &'a str, exists: &dyn Fn(&str) -> bool) -> Result<Input<'a>> {
    let placed = text.rsplit_once(AT).filter(|_| !exists(text));
    let (spec, place) = match placed.map(|(spec, at)| (spec, at, parse(at))) {
        Some((spec, at, None)) if exists(spec) => {
            return Err(SceneError(format!(
                "bad placement {at:?} for {spec}: use @x,y,z or @x,y,z*scale with a scale above 0"
            )));
        }
        Some((spec, _, place @ Some(_))) => (spec, place),
        _ => (text, None),
    };
    Ok(Input { spec, place })
}

/// Parses `x,y,z` or `x,y,z*scale`.
fn parse(text: &str) -> Option<InputPlacement> {
    let number = |t: &str| t.parse::<f64>().ok().filter(|x| (*x as f32).is_finite());
    let (at, scale) = text.split_once('*').unwrap_or((text, "1"));
    let numbers: Vec<f64> = at.split(',').map(number).collect::<Option<_>>()?;
    Some(InputPlacement {
        at: numbers.try_into().ok()?,
        scale: number(scale).map(|s| s as f32).filter(|&s| s > 0.0)?,
    })
}

/// Returns whether the name of a scene joins several inputs or places one. Fails if an input has an invalid placement or
/// no name.
pub fn is_joined(spec: &str) -> Result<bool> {
    let inputs = inputs(spec, &exists)?;
    Ok(!matches!(inputs[..], [Input { place: None, .. }]))
}

/// Opens the scene that `spec` names.
pub fn open(spec: &str, options: &SceneOptions) -> Result<Scene> {
    match inputs(spec, &exists)?.as_slice() {
        [Input { spec, place: None }] => open_one(spec, options),
        inputs => join(spec, inputs, options),
    }
}

/// Opens and joins all inputs.
fn join(spec: &str, inputs: &[Input<'_>], options: &SceneOptions) -> Result<Scene> {
    let has_clips = |input: &Input<'_>| is_gltf_input(input.spec);
    if !inputs.iter().any(has_clips) {
        refuse_clip(spec, options)?;
    }
    let without_clip = SceneOptions {
        clip: None,
        ..options.clone()
    };
    let open = |input: &Input<'_>| {
        let options = if has_clips(input) {
            options
        } else {
            &without_clip
        };
        open_one(input.spec, options)
    };
    let scenes = inputs.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let animations = || scenes.iter().map(|s| &s.animation);
    let vertices: usize = animations().map(|a| a.vertex_count()).sum();
    let triangles = animations().map(|a| a.triangle_count()).sum();
    let names: Vec<_> = scenes.iter().map(|s| s.name.as_str()).collect();
    let name = names.join("+");
    let keys = key_count(&scenes)?;
    let size = KeySize { keys, vertices };
    check_keys(&name, size, triangles, options)?;
    within(spec.as_ref(), "vertices", vertices, u32::MAX as usize)?;
    let places = inputs
        .iter()
        .map(|i| i.place.unwrap_or(InputPlacement::IDENTITY));
    let mut places: Vec<_> = places.collect();
    let mut facts = facts(&scenes);
    facts.offset = options.recentre.then(|| recentre(&mut places, &scenes));
    let positions = scenes.iter().zip(&places).flat_map(|(scene, place)| {
        let points = scene.animation.first().iter();
        points.map(|&p| RoundedPosition {
            exact: place.put_exactly(p.map(f64::from)),
            rounded: place.put(p),
        })
    });
    facts
        .notes
        .extend(remarks(&decode_path(spec), positions, options));
    let placed: Vec<_> = animations().map(Arc::clone).zip(places).collect();
    let source = move |key: usize| {
        let mut all = Vec::with_capacity(vertices);
        for (animation, place) in &placed {
            let own = animation.key(key.min(animation.key_count() - 1))?;
            all.extend(own.iter().map(|&p| place.put(p)));
        }
        Ok(all)
    };
    let meshes = animations().map(|a| (a.triangles(), a.vertex_count()));
    let triangles = joined_triangles(&name, meshes)?;
    let animation = paging::animation(source, None, size, triangles, options)?;
    Ok(Scene {
        name,
        animation: Arc::new(animation),
        facts,
        colours: scenes
            .iter()
            .flat_map(|s| s.colours.iter().copied())
            .collect(),
    })
}

/// Makes all placements relative to one offset, because each input was recentred by its own. Returns that offset: the
/// centre of the first input after its placement. For a demo, which is never recentred, its origin counts as its centre.
fn recentre(places: &mut [InputPlacement], scenes: &[Scene]) -> Position {
    let mut common = None;
    for (place, scene) in places.iter_mut().zip(scenes) {
        let centre = place.put_exactly(scene.facts.offset.unwrap_or_default());
        let offset = *common.get_or_insert(centre);
        place.at = std::array::from_fn(|i| centre[i] - offset[i]);
    }
    common.unwrap_or_default()
}

/// Returns the number of key frames of the joined scene: that of the moving inputs, or 1.
fn key_count(scenes: &[Scene]) -> Result<usize> {
    let count = |scene: &Scene| scene.animation.key_count();
    let mut moving = scenes.iter().filter(|s| count(s) > 1);
    let Some(first) = moving.next() else {
        return Ok(1);
    };
    match moving.find(|s| count(s) != count(first)) {
        None => Ok(count(first)),
        Some(other) => Err(SceneError(format!(
            "{} has {} key frames and {} {}: moving inputs must have the same number of key frames; \
             an input with a single key frame is static",
            first.name,
            count(first),
            other.name,
            count(other)
        ))),
    }
}

fn facts(scenes: &[Scene]) -> Facts {
    let facts = || scenes.iter().map(|s| &s.facts);
    let mut formats: Vec<&str> = facts().map(|f| f.format.as_str()).collect();
    formats.dedup();
    let clips: Vec<&str> = facts().filter_map(|f| f.clip.as_deref()).collect();
    let notes = scenes.iter().flat_map(|s| {
        let notes = s.facts.notes.iter();
        notes.map(|note| format!("{}: {note}", s.name))
    });
    Facts {
        format: formats.join("+"),
        files: facts().flat_map(|f| f.files.clone()).collect(),
        clip: (!clips.is_empty()).then(|| clips.join("+")),
        seconds_per_key: facts().find_map(|f| f.seconds_per_key),
        notes: notes.collect(),
        ..Facts::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{open_in, put, refused};
    use tempfile::TempDir;

    /// Names of existing inputs.
    const EXISTING: [&str; 6] = ["a.obj", "b.glb", "a+b.obj", "b@1,2,3", "c+", "demo:hall"];

    /// Name of an input, and its placement as translation and scale.
    type ParsedInput<'a> = (&'a str, Option<(Position, f32)>);

    fn exists(name: &str) -> bool {
        EXISTING.contains(&name)
    }

    fn parsed(spec: &str) -> Vec<ParsedInput<'_>> {
        let inputs = inputs(spec, &exists).unwrap();
        let place = |p: InputPlacement| (p.at, p.scale);
        let parsed = inputs.iter().map(|i| (i.spec, i.place.map(place)));
        parsed.collect()
    }

    #[test]
    fn existing_names_win_over_separators() {
        assert_eq!(parsed("a.obj"), [("a.obj", None)]);
        assert_eq!(parsed("a.obj+b.glb"), [("a.obj", None), ("b.glb", None)]);
        assert_eq!(parsed("a+b.obj"), [("a+b.obj", None)]);
        assert_eq!(
            parsed("a+b.obj+a.obj"),
            [("a+b.obj", None), ("a.obj", None)]
        );
        assert_eq!(
            parsed("a.obj+a+b.obj"),
            [("a.obj", None), ("a+b.obj", None)]
        );
        assert_eq!(parsed("c++b.glb"), [("c+", None), ("b.glb", None)]);
        assert_eq!(parsed("b@1,2,3"), [("b@1,2,3", None)]);
        let at = Some(([1.0, -2.5, 300.0], 1.0));
        assert_eq!(parsed("a.obj@1,-2.5,3e+2"), [("a.obj", at)]);
        let placed = [("demo:hall", None), ("b.glb", Some(([0.0, 1.0, 0.0], 0.5)))];
        assert_eq!(parsed("demo:hall+b.glb@0,1,0*0.5"), placed);
        let again = [("b@1,2,3", Some(([4.0, 5.0, 6.0], 1.0))), ("a.obj", None)];
        assert_eq!(parsed("b@1,2,3@4,5,6+a.obj"), again);
        // Inputs that do not exist keep their names as written, for the error message.
        assert_eq!(
            parsed("x.obj+y@z.obj"),
            [("x.obj", None), ("y@z.obj", None)]
        );
        for nameless in ["a.obj+", "+", "+a.obj", "a.obj++b.glb", "@1,2,3"] {
            refused(inputs(nameless, &exists), &[nameless, "has no name"]);
        }
    }

    #[test]
    fn rejects_malformed_placements() {
        for bad in [
            "", "1,2", "1,2,3,4", "1,2,x", "1,2,3*0", "1,2,3*-1", "1,2,inf",
        ] {
            let spec = format!("a.obj@{bad}");
            refused(inputs(&spec, &exists), &["a.obj", "@x,y,z"]);
        }
    }

    fn folder() -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, x: f32| {
            let text = format!("v {x} -0.0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
            put(&folder, name, text);
        };
        write("still.obj", 5.0);
        write("two/1.obj", 0.0);
        write("two/2.obj", 1.0);
        (1..=3).for_each(|k| write(&format!("three/{k}.obj"), k as f32));
        folder
    }

    #[test]
    fn joins_inputs_in_order() {
        let folder = folder();
        let scene = open_in(&folder, "still.obj+two@10,0,0*2", &SceneOptions::default()).unwrap();
        let a = &scene.animation;
        assert_eq!(a.triangles(), [[0, 1, 2], [3, 4, 5]]);
        let keys = a.all_keys().unwrap();
        let firsts: Vec<_> = keys.iter().map(|k| [k[0][0], k[3][0], k[5][1]]).collect();
        assert_eq!(firsts, [[5.0, 10.0, 2.0], [5.0, 12.0, 2.0]]);
        assert_eq!((scene.name.as_str(), scene.colours.len()), ("still+two", 2));
        let facts = &scene.facts;
        assert_eq!((facts.files.len(), facts.format.as_str()), (3, "obj"));
        // Joining maps the file's -0 to +0. A -0 would count as motion, because interpolation changes it.
        assert_eq!(a.static_parts().triangles, [true, false]);
    }

    #[test]
    fn rejects_inputs_with_different_key_counts() {
        let folder = folder();
        let open = |names| open_in(&folder, names, &SceneOptions::default());
        let says = ["two has 2", "three 3", "single"];
        refused(open("two+still.obj+three"), &says);
        refused(open("two+gone.obj"), &["gone.obj: no such file"]);
    }

    #[test]
    fn clip_option_requires_inputs_with_clips() {
        let folder = folder();
        let options = SceneOptions {
            clip: Some("Walk".to_owned()),
            ..SceneOptions::default()
        };
        for names in ["still.obj+two", "still.obj", "two", "two/*.obj"] {
            refused(open_in(&folder, names, &options), &["Walk"]);
        }
        assert!(crate::open("demo:twist:100", &options).is_err());
        put(&folder, "figure.glb", "");
        let matched = open_in(&folder, "fig*@1,2,3", &options);
        refused(matched, &["figure.glb: ", "not glTF"]);
        let gone = open_in(&folder, "still.obj+gone.glb", &options);
        refused(gone, &["gone.glb: no such file"]);
    }

    #[test]
    fn splits_many_inputs_in_linear_time() {
        let exists_calls = |count: usize, folder: &str| {
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
            let (few, many) = (exists_calls(200, folder), exists_calls(800, folder));
            assert!(many <= 6 * few, "{folder}: {few} calls, then {many}");
        }
    }
}
