//! What `auto` takes, and why.

use crate::args::{IntersectorName, LayoutName, MethodArgs, PolicyArgs, UpdateName};
use crate::stop::Stop;
use backend::{Intersector, Layout, Method};
use output::Taken;
use pipeline::{Pace, Update};

/// Something taken, and the reason where nobody asked for it by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Choice<T> {
    /// What is taken.
    pub(crate) value: T,
    /// Why; `None` if it was asked for.
    pub(crate) why: Option<&'static str>,
    /// Whether it is left to `auto`, which knows more once the backend is open.
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

/// How trees follow the motion. What is left open, [`pipeline::RunFacts`] settle where a run is known.
pub(crate) fn update(policy: PolicyArgs) -> Result<Choice<Update>, Stop> {
    let pace = policy.lockstep.map_or(Pace::Free, Pace::Lockstep);
    let fixed = match policy.update {
        UpdateName::Async => return Ok(asked(Update::Async(pace))),
        UpdateName::Auto if policy.lockstep.is_some() => {
            return Ok(auto(Update::Async(pace), "--lockstep asks for it"));
        }
        UpdateName::Auto => {
            return Ok(Choice {
                is_open: true,
                ..auto(Update::Async(pace), "it suits most scenes that deform")
            });
        }
        UpdateName::Rebuild => Update::Rebuild,
        UpdateName::Refit => Update::Refit,
        UpdateName::TSah => Update::TSah,
        UpdateName::DeviceRebuild => Update::DeviceRebuild,
    };
    match policy.lockstep {
        Some(_) => Err(Stop::bad("--lockstep goes only with --update async")),
        None => Ok(asked(fixed)),
    }
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

    fn choose(update: UpdateName, lockstep: Option<u32>) -> Option<Update> {
        let chosen = super::update(PolicyArgs { update, lockstep });
        chosen.ok().map(|c| c.value)
    }

    #[test]
    fn lockstep_goes_only_with_async() {
        assert_eq!(choose(UpdateName::Rebuild, Some(1)), None);
        assert_eq!(choose(UpdateName::Refit, Some(0)), None);
        assert_eq!(choose(UpdateName::TSah, Some(1)), None);
        assert_eq!(choose(UpdateName::DeviceRebuild, Some(1)), None);
        assert_eq!(choose(UpdateName::TSah, None), Some(Update::TSah));
        assert_eq!(
            choose(UpdateName::Auto, Some(3)),
            choose(UpdateName::Async, Some(3))
        );
        let three = Some(Update::Async(Pace::Lockstep(3)));
        assert_eq!(choose(UpdateName::Async, Some(3)), three);
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
        assert_eq!(within_frames(asked(free.value)), asked(free.value));
        let refit = auto(Update::Refit, "it stands still");
        assert_eq!(within_frames(refit), refit);
    }
}
