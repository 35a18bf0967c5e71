//! Which ways of tracing there are here.

use crate::args::{BackendName, ChartArgs, IntersectorName, LayoutName, MethodArgs, UpdateName};
use crate::stop::Stop;
use crate::{adapters, choose, open};
use backend::DeviceKind;
use clap::ValueEnum;
use std::fmt;

/// One way of tracing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) backend: BackendName,
    /// Whether somebody asked for the backend by name.
    pub(super) named: bool,
    pub(super) method: MethodArgs,
    pub(super) update: UpdateName,
}

/// All ways, and why others are none.
pub(super) struct ChartPlan {
    pub(super) scenes: Vec<String>,
    pub(super) ways: Vec<Way>,
    /// Remarks, one line each.
    pub(super) skipped: Vec<String>,
}

impl ChartPlan {
    /// Everything with everything, as far as backends support it.
    pub(super) fn of(args: &ChartArgs) -> Result<Self, Stop> {
        let mut skipped = Vec::new();
        let mut ways = Vec::new();
        for (backend, named) in backends(args, &mut skipped) {
            for method in methods(args) {
                let way = |&update: &UpdateName| Way {
                    backend,
                    named,
                    method,
                    update,
                };
                ways.extend(unique(&args.policies.update).iter().map(way));
            }
        }
        if ways.is_empty() {
            return Err(Stop::bad(format!(
                "there is nothing to chart: {}",
                skipped.join("; ")
            )));
        }
        Ok(Self {
            scenes: unique(&args.scenes),
            ways,
            skipped,
        })
    }

    /// Steps of work: every way is timed and judged on each scene, which has its
    /// answers found and its key frames reduced; and every method is tried on closed bodies.
    pub(super) fn steps(&self) -> u64 {
        let methods: Vec<_> = self.ways.iter().map(|w| (w.backend, w.method)).collect();
        (self.scenes.len() * (2 * self.ways.len() + 2) + unique(&methods).len()) as u64
    }
}

/// Backends to be charted, the host first, and whether each was named.
fn backends(args: &ChartArgs, skipped: &mut Vec<String>) -> Vec<(BackendName, bool)> {
    let named = |name| args.backend.contains(&name);
    if !named(BackendName::Auto) {
        let (drivers, ours): (Vec<_>, Vec<_>) = unique(&args.backend)
            .into_iter()
            .partition(|&b| open::has_own_trees(b));
        skipped.extend(drivers.into_iter().map(|b| left_to_driver(&word(b))));
        return ours.into_iter().map(|b| (b, true)).collect();
    }
    let mut found = Vec::new();
    for presence in open::presences().into_iter().rev() {
        let Ok(name) = BackendName::from_str(presence.backend, true) else {
            continue;
        };
        if presence.own_trees {
            skipped.push(left_to_driver(presence.backend));
            continue;
        }
        let fits = presence
            .adapters
            .iter()
            .any(|a| a.kind != DeviceKind::Software);
        if named(name) || fits {
            found.push((name, named(name)));
            continue;
        }
        let why = presence.absent.unwrap_or_else(|| {
            let there = adapters::numbered(&presence.adapters);
            format!("it finds no GPU but {there}; --backend takes it by name")
        });
        skipped.push(format!("{} is left out: {why}", presence.backend));
    }
    found
}

fn left_to_driver(backend: &str) -> String {
    format!("{backend} is left out: what its rays hit is the driver's affair, not an intersector's")
}

/// Every intersector asked for with every layout there is.
fn methods(args: &ChartArgs) -> Vec<MethodArgs> {
    let intersectors: Vec<_> = args.intersector.iter().map(|&i| settled(i)).collect();
    let mut methods = Vec::new();
    for intersector in unique(&intersectors) {
        for layout in [LayoutName::Bvh2, LayoutName::Fast] {
            methods.push(MethodArgs {
                intersector,
                layout,
            });
        }
    }
    methods
}

/// The intersector that `auto` stands for.
fn settled(name: IntersectorName) -> IntersectorName {
    let taken = choose::intersector(name).value;
    IntersectorName::from_str(taken.name(), true).unwrap_or(name)
}

/// Each once, in order.
fn unique<T: PartialEq + Clone>(all: &[T]) -> Vec<T> {
    let mut kept: Vec<T> = Vec::new();
    for one in all {
        if !kept.contains(one) {
            kept.push(one.clone());
        }
    }
    kept
}

/// A name as it stands on the command line.
fn word(name: impl ValueEnum) -> String {
    let value = name.to_possible_value();
    value.map_or_else(String::new, |v| v.get_name().to_owned())
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let MethodArgs {
            intersector,
            layout,
        } = self.method;
        let words = [word(self.backend), word(layout), word(intersector)];
        write!(f, "{} {}", words.join(" "), word(self.update))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::{PoliciesArgs, SizeArgs, WarmUpArgs};
    use crate::values::Frames;
    use std::path::PathBuf;

    fn args(intersector: &[IntersectorName]) -> ChartArgs {
        ChartArgs {
            scenes: vec!["a".to_owned(), "b".to_owned(), "a".to_owned()],
            source: crate::args::SourceArgs {
                fps: 24.0,
                clip: None,
                allow_outside: false,
            },
            out: PathBuf::new(),
            backend: vec![BackendName::Cpu],
            intersector: intersector.to_vec(),
            policies: PoliciesArgs {
                update: vec![UpdateName::Refit, UpdateName::Async, UpdateName::Refit],
            },
            frames: Frames::Count(1),
            size: SizeArgs { size: [1, 1] },
            warm_up: WarmUpArgs::default(),
            rays: 1,
            quiet: true,
        }
    }

    #[test]
    fn what_is_asked_for_twice_is_done_once() {
        use IntersectorName as I;
        let plan = ChartPlan::of(&args(&[I::Woop, I::Auto, I::Exact])).unwrap();
        let ways: Vec<_> = plan.ways.iter().map(ToString::to_string).collect();
        let expected = [
            "cpu bvh2 woop refit",
            "cpu bvh2 woop async",
            "cpu fast woop refit",
            "cpu fast woop async",
            "cpu bvh2 exact refit",
            "cpu bvh2 exact async",
            "cpu fast exact refit",
            "cpu fast exact async",
        ];
        assert_eq!(ways, expected);
        assert_eq!(plan.scenes, ["a", "b"]);
        assert_eq!(plan.steps(), 2 * (2 * 8 + 2) + 4);
        assert!(plan.skipped.is_empty(), "{:?}", plan.skipped);
    }

    #[test]
    fn a_plan_without_a_way_says_what_is_missing() {
        let none = ChartArgs {
            backend: vec![BackendName::VulkanRt],
            ..args(&[IntersectorName::Woop])
        };
        let why = ChartPlan::of(&none).err().unwrap().text();
        assert!(why.contains("vulkan-rt is left out"), "{why}");
    }
}
