//! Several inputs as one scene: `hall.obj+figure.glb@2,0,-1*0.5`.
//!
//! Inputs stand in the order of their names, so the first one's triangles come
//! first. Inputs that move must have equally many key frames; one with a single
//! key frame stands still and is repeated.

use crate::mesh::{check_keys, joined_triangles, within};
use crate::{Facts, Options, Result, Scene, SceneError, source, stream};
use geom::{Animation, Point};
use std::sync::Arc;

/// Between two inputs.
const AND: char = '+';
/// Between an input and where it stands.
const AT: char = '@';

/// One input and where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Input<'a> {
    /// What names it alone.
    pub(crate) spec: &'a str,
    /// `None` if it stands as it is.
    pub(crate) place: Option<Placement>,
}

/// A point `p` comes to stand at `p * scale + at`, each operation rounded once.
/// So a zero is a positive one, even where an input stands as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    at: Point,
    scale: f32,
}

const AS_IT_IS: Placement = Placement {
    at: [0.0; 3],
    scale: 1.0,
};

/// The inputs that a scene's name is made of. A name that `exists` as it is, is one input whatever it contains.
///
/// # Errors
/// What follows `@` is no place.
pub(crate) fn inputs<'a>(spec: &'a str, exists: &dyn Fn(&str) -> bool) -> Result<Vec<Input<'a>>> {
    let mut inputs = Vec::new();
    let mut rest = spec;
    loop {
        let (first, after) = first_input(rest, exists);
        inputs.push(input(first, exists)?);
        match after {
            Some(after) => rest = after,
            None => return Ok(inputs),
        }
    }
}

/// The longest beginning that names something, up to a `+` or the end; else what is before the first `+`.
///
/// Several inputs are found by beginnings of some length alone, lest many take the square of their number.
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

fn input<'a>(text: &'a str, exists: &dyn Fn(&str) -> bool) -> Result<Input<'a>> {
    if let Some((spec, at)) = text.rsplit_once(AT).filter(|_| !exists(text)) {
        let place = parse(at);
        if place.is_some() {
            return Ok(Input { spec, place });
        }
        if exists(spec) {
            return Err(SceneError(format!(
                "bad place {at:?} for {spec}: give @x,y,z or @x,y,z*scale, with a scale above 0"
            )));
        }
    }
    Ok(Input {
        spec: text,
        place: None,
    })
}

/// `x,y,z` or `x,y,z*scale`.
fn parse(text: &str) -> Option<Placement> {
    let number = |t: &str| t.parse::<f32>().ok().filter(|x| x.is_finite());
    let (at, scale) = text.split_once('*').unwrap_or((text, "1"));
    let numbers: Vec<f32> = at.split(',').map(number).collect::<Option<_>>()?;
    Some(Placement {
        at: numbers.try_into().ok()?,
        scale: number(scale).filter(|&s| s > 0.0)?,
    })
}

/// Opens every input and joins them.
///
/// # Errors
/// Those of each, or inputs that move have different numbers of key frames.
pub(crate) fn open(spec: &str, inputs: &[Input<'_>], options: &Options) -> Result<Scene> {
    if !inputs.iter().any(|i| source::has_clips(i.spec)) {
        source::refuse_clip(spec, options)?;
    }
    let still = Options {
        clip: None,
        ..options.clone()
    };
    let open = |input: &Input<'_>| {
        let has_clips = source::has_clips(input.spec);
        source::open_one(input.spec, if has_clips { options } else { &still })
    };
    let scenes = inputs.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let animations = || scenes.iter().map(|s| &s.animation);
    let vertices: usize = animations().map(|a| a.vertex_count()).sum();
    let triangles = animations().map(|a| a.triangle_count()).sum();
    let name = joined(scenes.iter().map(|s| s.name.as_str()));
    let keys = key_count(&scenes)?;
    check_keys(&name, (keys, vertices, triangles), options)?;
    within(spec.as_ref(), "vertices", vertices, u32::MAX as usize)?;
    let places = inputs.iter().map(|i| i.place.unwrap_or(AS_IT_IS));
    let placed: Vec<_> = animations().map(Arc::clone).zip(places).collect();
    let source = move |key: usize| {
        let mut all = Vec::with_capacity(vertices);
        for (animation, place) in &placed {
            let own = animation.key(key.min(animation.key_count() - 1))?;
            all.extend(own.iter().map(|&p| place.put(p)));
        }
        Ok(all)
    };
    let triangles = joined_triangles(animations().map(|a| (a.triangles(), a.vertex_count())));
    let animation = stream::animation(source, (keys, vertices), triangles, options)?;
    Ok(Scene {
        name,
        animation: Arc::new(timed(spec, animation, &scenes)?),
        facts: facts(&scenes),
        colours: scenes
            .iter()
            .flat_map(|s| s.colours.iter().copied())
            .collect(),
    })
}

/// With the times that the key frames of all inputs that move have in common, if they have times of their own.
fn timed(spec: &str, joined: Animation, scenes: &[Scene]) -> Result<Animation> {
    let moving = || {
        scenes
            .iter()
            .map(|s| &s.animation)
            .filter(|a| a.key_count() > 1)
    };
    let Some(first) = moving().find(|a| a.times().is_some()) else {
        return Ok(joined);
    };
    let same = |a: &Arc<Animation>| a.times() == first.times() && a.end() == first.end();
    let bad = |cause: String| SceneError::unusable(spec, cause);
    if !moving().all(same) {
        let cause = "the key frames of one input are at other times than those of another";
        return Err(bad(cause.to_owned()));
    }
    let times = first.times().unwrap_or_default().to_vec();
    joined
        .timed(times, first.end())
        .map_err(|e| bad(e.to_string()))
}

/// Key frames of all: those of any input that has more than one.
fn key_count(scenes: &[Scene]) -> Result<usize> {
    let count = |scene: &Scene| scene.animation.key_count();
    let mut moving = scenes.iter().filter(|s| count(s) > 1);
    let Some(first) = moving.next() else {
        return Ok(1);
    };
    match moving.find(|s| count(s) != count(first)) {
        None => Ok(count(first)),
        Some(other) => Err(SceneError(format!(
            "{} has {} key frames and {} {}: inputs that move must have equally many; \
             one with a single key frame is repeated",
            first.name,
            count(first),
            other.name,
            count(other)
        ))),
    }
}

impl Placement {
    fn put(self, p: Point) -> Point {
        std::array::from_fn(|i| p[i] * self.scale + self.at[i])
    }
}

fn facts(scenes: &[Scene]) -> Facts {
    let mut formats: Vec<&str> = scenes.iter().map(|s| s.facts.format.as_str()).collect();
    formats.dedup();
    let facts = || scenes.iter().map(|s| &s.facts);
    let clips: Vec<&str> = facts().filter_map(|f| f.clip.as_deref()).collect();
    let note = |s: &Scene| {
        let told = |n: &String| format!("{}: {n}", s.name);
        s.facts.notes.iter().map(told).collect::<Vec<_>>()
    };
    Facts {
        format: joined(formats.iter().copied()),
        files: facts().flat_map(|f| f.files.clone()).collect(),
        clip: (!clips.is_empty()).then(|| joined(clips.iter().copied())),
        seconds_per_key: facts().find_map(|f| f.seconds_per_key),
        notes: scenes.iter().flat_map(note).collect(),
    }
}

fn joined<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join("+")
}

#[cfg(test)]
mod tests;
