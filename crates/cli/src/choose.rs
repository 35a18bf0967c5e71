//! What `auto` takes, and why.

use crate::args::{IntersectorName, LayoutName, MethodArgs, PolicyArgs, UpdateName};
use crate::motion;
use crate::stop::Stop;
use backend::{Intersector, Layout, Method};
use geom::Animation;
use pipeline::{Frame, Pace, Update};
use report::Taken;

/// Something taken, and the reason where nobody asked for it by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Choice<T> {
    /// What is taken.
    pub(crate) value: T,
    /// Why; `None` if it was asked for.
    pub(crate) why: Option<&'static str>,
    /// Whether it is but a guess, which a trial may better.
    pub(crate) is_open: bool,
}

/// What `auto` took where nothing was asked for by name.
pub(crate) fn taken(what: &str, takes: &str, why: Option<&str>) -> Option<Taken> {
    Some(Taken {
        what: what.to_owned(),
        takes: takes.to_owned(),
        why: why?.to_owned(),
    })
}

/// What somebody named.
pub(crate) fn asked<T>(value: T) -> Choice<T> {
    Choice {
        value,
        why: None,
        is_open: false,
    }
}

/// What nothing can be better than.
fn auto<T>(value: T, why: &'static str) -> Choice<T> {
    let why = Some(why);
    Choice {
        value,
        why,
        is_open: false,
    }
}

/// What is the best as a rule.
fn guess<T>(value: T, why: &'static str) -> Choice<T> {
    let is_open = true;
    Choice {
        is_open,
        ..auto(value, why)
    }
}

/// Key frames between frames from which on the tree of an earlier frame is of no use.
const FAR_APART: f64 = 2.0;

/// How trees follow the motion through `frames`.
///
/// The backend has no say. A GPU's frames are short, so that a build spans many of them; yet with
/// a quarter to two fifths of a key frame from frame to frame, `async` took 16 to 28 % of the wall
/// time of `rebuild` on an H200 in three demos, and 5 % of that of `refit` where a body breaks up
/// (`results/2026-11-21-h200`). Frames further apart were not measured there.
pub(crate) fn update(
    policy: PolicyArgs,
    animation: &Animation,
    frames: &[Frame],
) -> Result<Choice<Update>, Stop> {
    let pace = policy.lockstep.map_or(Pace::Free, Pace::Lockstep);
    let choice = match (policy.update, policy.lockstep) {
        (
            UpdateName::Rebuild | UpdateName::Refit | UpdateName::TSah | UpdateName::DeviceRebuild,
            Some(_),
        ) => {
            return Err(Stop::bad("--lockstep goes only with --update async"));
        }
        (UpdateName::Rebuild, None) => asked(Update::Rebuild),
        (UpdateName::Refit, None) => asked(Update::Refit),
        (UpdateName::TSah, None) => asked(Update::TSah),
        (UpdateName::DeviceRebuild, None) => asked(Update::DeviceRebuild),
        (UpdateName::Async, _) => asked(Update::Async(pace)),
        (UpdateName::Auto, Some(_)) => auto(Update::Async(pace), "--lockstep asks for it"),
        (UpdateName::Auto, None) if motion::is_static(animation) => auto(
            Update::Refit,
            "the scene does not move, so its first tree stays the best",
        ),
        (UpdateName::Auto, None) if frames.len() == 1 => {
            auto(Update::Refit, "one frame needs one tree")
        }
        (UpdateName::Auto, None) if step(frames) >= FAR_APART => guess(
            Update::Rebuild,
            "the frames lie key frames apart, so that the tree of one is of no use to the next",
        ),
        (UpdateName::Auto, None) => guess(
            Update::Async(pace),
            "the scene deforms: frames go on with the newest tree while the next one is built",
        ),
    };
    Ok(choice)
}

/// What a method names that a driver with trees of its own does not have. The usual intersector, which nobody need
/// name, stands for the driver's own.
pub(crate) fn beyond_drivers(method: MethodArgs) -> Option<String> {
    let MethodArgs {
        intersector,
        layout,
    } = method;
    if !matches!(
        intersector,
        IntersectorName::Auto | IntersectorName::Watertight
    ) {
        let name = self::intersector(intersector).value;
        return Some(format!("intersector '{name}'"));
    }
    let name = self::layout(layout).value;
    (layout != LayoutName::Auto).then(|| format!("layout '{name}'"))
}

/// The same for a backend that makes its trees itself, within each frame.
pub(crate) fn within_frames(choice: Choice<Update>) -> Choice<Update> {
    match choice {
        Choice {
            value: Update::Async(_),
            why: Some(_),
            ..
        } => auto(
            Update::Rebuild,
            "the backend makes its trees itself, within each frame",
        ),
        asked => asked,
    }
}

/// Key frames from one frame to the next, in the mean.
fn step(frames: &[Frame]) -> f64 {
    match frames {
        [first, .., last] => (last.time - first.time).abs() / (frames.len() - 1) as f64,
        _ => 0.0,
    }
}

/// How a ray is tested against a triangle.
pub(crate) fn intersector(name: IntersectorName) -> Choice<Intersector> {
    match name {
        IntersectorName::Auto => auto(
            Intersector::Exact,
            "it alone is free of wrong answers by definition",
        ),
        IntersectorName::MollerTrumbore => asked(Intersector::MollerTrumbore),
        IntersectorName::Woop => asked(Intersector::Woop),
        IntersectorName::Watertight => asked(Intersector::Watertight),
        IntersectorName::Exact => asked(Intersector::Exact),
    }
}

/// How the tree lies in memory.
pub(crate) fn layout(name: LayoutName) -> Choice<Layout> {
    match name {
        LayoutName::Auto => auto(Layout::Bvh2, "every backend has it"),
        LayoutName::Bvh2 => asked(Layout::Bvh2),
        LayoutName::Fast => asked(Layout::Fast),
    }
}

/// Both at once.
pub(crate) fn method(args: MethodArgs) -> Method {
    Method {
        intersector: intersector(args.intersector).value,
        layout: layout(args.layout).value,
    }
}

/// The policy's name on the command line.
pub(crate) fn update_name(update: Update) -> &'static str {
    match update {
        Update::Rebuild => "rebuild",
        Update::Refit => "refit",
        Update::Async(_) => "async",
        Update::TSah => "t-sah",
        Update::DeviceRebuild => "device-rebuild",
    }
}

/// Frames between asking for a tree and taking it up, where fixed.
pub(crate) fn lockstep(update: Update) -> Option<u64> {
    match update {
        Update::Async(Pace::Lockstep(k)) => Some(u64::from(k)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn animation(x: f32) -> Animation {
        let key = |x| vec![[0.0; 3], [1.0, 0.0, 0.0], [x, 1.0, f32::NAN]];
        Animation::new(vec![key(0.0), key(x)], vec![[0, 1, 2]]).unwrap()
    }

    fn frames(times: &[f64]) -> Vec<Frame> {
        let frame = |(index, &time)| Frame { index, time };
        (0..).zip(times).map(frame).collect()
    }

    fn choose(update: UpdateName, lockstep: Option<u32>, x: f32) -> Option<Update> {
        let policy = PolicyArgs { update, lockstep };
        let chosen = super::update(policy, &animation(x), &frames(&[0.0, 0.5, 1.0]));
        chosen.ok().map(|c| c.value)
    }

    fn auto_for(times: &[f64]) -> Update {
        let policy = PolicyArgs {
            update: UpdateName::Auto,
            lockstep: None,
        };
        super::update(policy, &animation(0.5), &frames(times))
            .unwrap()
            .value
    }

    #[test]
    fn auto_builds_once_for_what_stands_still_and_again_for_what_moves() {
        assert_eq!(choose(UpdateName::Auto, None, 0.0), Some(Update::Refit));
        let free = Some(Update::Async(Pace::Free));
        assert_eq!(choose(UpdateName::Auto, None, 0.5), free);
        assert_eq!(auto_for(&[1.0]), Update::Refit);
        assert_eq!(auto_for(&[0.0, 5.0, 10.0]), Update::Rebuild);
        assert_eq!(auto_for(&[0.0, 1.0, 2.0]), Update::Async(Pace::Free));
    }

    #[test]
    fn lockstep_goes_only_with_async() {
        assert_eq!(choose(UpdateName::Rebuild, Some(1), 0.5), None);
        assert_eq!(choose(UpdateName::Refit, Some(0), 0.5), None);
        assert_eq!(choose(UpdateName::TSah, Some(1), 0.5), None);
        assert_eq!(choose(UpdateName::DeviceRebuild, Some(1), 0.5), None);
        assert_eq!(choose(UpdateName::TSah, None, 0.5), Some(Update::TSah));
        let three = Some(Update::Async(Pace::Lockstep(3)));
        assert_eq!(choose(UpdateName::Async, Some(3), 0.5), three);
    }

    #[test]
    fn a_drivers_own_intersector_stands_for_the_usual_one_alone() {
        use IntersectorName as I;
        use LayoutName as L;
        let beyond = |intersector, layout| {
            beyond_drivers(MethodArgs {
                intersector,
                layout,
            })
        };
        assert_eq!(beyond(I::Auto, L::Auto), None);
        assert_eq!(beyond(I::Watertight, L::Auto), None);
        let named = beyond(I::Woop, L::Auto).unwrap();
        assert_eq!(named, "intersector 'woop'");
        assert_eq!(beyond(I::Auto, L::Bvh2).unwrap(), "layout 'bvh2'");
    }

    #[test]
    fn a_driver_rebuilds_where_nobody_asked_for_more() {
        let free = auto(Update::Async(Pace::Free), "because");
        assert_eq!(within_frames(free).value, Update::Rebuild);
        assert_eq!(within_frames(guess(free.value, "")).value, Update::Rebuild);
        assert_eq!(within_frames(asked(free.value)), asked(free.value));
        let refit = auto(Update::Refit, "it stands still");
        assert_eq!(within_frames(refit), refit);
    }
}
