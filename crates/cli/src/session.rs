//! A driver set up as asked, ready for its first frame.

use crate::args::{IntersectorName, LayoutName, MethodArgs};
pub(crate) use crate::choose::Ask;
use crate::choose::{self, ReusedBackend, Settled};
use crate::memory::{self, ExpectedMemory};
use crate::open::{self, Want};
use crate::stop::Stop;
use crate::threads::{self, Threads};
use backend::{Backend, Device, DeviceKind};
use geom::Animation;
use output::Taken;
use pipeline::{Driver, Update};
use std::sync::Arc;

/// A driver, and what it was made from.
pub(crate) struct Session {
    /// The driver.
    pub(crate) driver: Driver,
    /// Who is at work.
    pub(crate) device: Device,
    /// How rays are traced and how trees lie in memory, by name.
    pub(crate) method: [&'static str; 2],
    /// How trees follow the motion.
    pub(crate) update: Update,
    /// With `async`: whether trees are built for what comes.
    pub(crate) predict: Option<bool>,
    /// How cores are shared.
    pub(crate) threads: Threads,
    /// What it may take.
    pub(crate) memory: ExpectedMemory,
    /// What `auto` took and why.
    pub(crate) taken: Vec<Taken>,
    /// Likewise, for people: one remark each.
    pub(crate) remarks: Vec<String>,
}

/// Opens the backend, settles what is left to `auto`, and loads the scene.
pub(crate) fn start(animation: &Arc<Animation>, ask: &Ask<'_>) -> Result<Session, Stop> {
    let rays = ask.rays();
    memory::check_trees(animation.triangle_count(), rays)?;
    let ask = &for_backend(ask)?;
    let want = want(ask);
    let opened = open::open(&want, |backend: Box<dyn Backend>| {
        let device = backend.device().clone();
        let mut backend = ReusedBackend::new(backend, animation, ask);
        let settled = choose::settle(&mut backend, ask)?;
        let driver = backend.driver(settled.method, settled.update)?;
        let threads = backend.share(settled.update);
        Ok((driver, device, settled, threads))
    })?;
    let (mut driver, device, settled, threads) = opened.value;
    let names = method_names(ask, &settled);
    let taken = taken((&device, opened.why.as_deref()), &settled, names);
    let how = (settled.method, settled.update);
    Ok(Session {
        memory: ExpectedMemory::of(animation, device.kind, how, rays),
        device: driver.backend().device().clone(),
        driver,
        threads,
        method: names,
        update: settled.update,
        predict: matches!(settled.update, Update::Async(_)).then_some(ask.ahead.predict),
        remarks: taken.iter().map(ToString::to_string).collect(),
        taken,
    })
}

/// What to open.
fn want<'a>(ask: &Ask<'a>) -> Want<'a> {
    let cores = threads::cores();
    let (render, build) = (ask.threads, ask.builder_threads);
    Want {
        backend: ask.backend,
        adapter: ask.adapter,
        threads: threads::share(cores, DeviceKind::Cpu, ask.update.value, render, build).render,
    }
}

/// What is asked of a backend that makes its trees itself: nothing is left to choose there.
fn for_backend<'a>(ask: &Ask<'a>) -> Result<Ask<'a>, Stop> {
    if !open::has_own_trees(ask.backend) {
        return Ok(*ask);
    }
    if let Some(what) = choose::beyond_drivers(ask.method) {
        return Err(Stop::bad(format!(
            "a driver that makes its own trees has its own intersector and layout: it does not know {what}"
        )));
    }
    Ok(Ask {
        update: choose::within_frames(ask.update),
        run: None,
        rays: ask.rays(),
        method: MethodArgs {
            intersector: IntersectorName::Watertight,
            layout: LayoutName::Auto,
        },
        ..*ask
    })
}

/// Names of the intersector and the layout.
fn method_names(ask: &Ask<'_>, settled: &Settled) -> [&'static str; 2] {
    match open::has_own_trees(ask.backend) {
        true => [open::DRIVERS; 2],
        false => [
            settled.method.intersector.name(),
            settled.method.layout.name(),
        ],
    }
}

/// What `auto` took and why.
fn taken(
    (device, why): (&Device, Option<&str>),
    settled: &Settled,
    [intersector, layout]: [&'static str; 2],
) -> Vec<Taken> {
    let update = settled.update.name();
    let own = (intersector == open::DRIVERS).then_some("the driver has its own");
    let why_intersector = own.or(settled.why_intersector.as_deref());
    let why_layout = own.or(settled.why_layout);
    let all = [
        choose::taken("backend", device.backend, why),
        choose::taken("update", update, settled.why_update.as_deref()),
        choose::taken("intersector", intersector, why_intersector),
        choose::taken("layout", layout, why_layout),
    ];
    all.into_iter().flatten().collect()
}

impl Session {
    /// Who works how, in one line.
    pub(crate) fn caption(&self) -> String {
        let lockstep =
            choose::lockstep(self.update).map_or(String::new(), |k| format!(" lockstep {k}"));
        let predict = match self.predict {
            Some(false) => " without prediction",
            _ => "",
        };
        let render = match self.device.threads {
            0 => String::new(),
            1 => "1 thread renders, ".to_owned(),
            n => format!("{n} threads render, "),
        };
        let build = match self.threads.build {
            1 => "1 thread builds".to_owned(),
            n => format!("{n} threads build"),
        };
        format!(
            "{} ({}; {render}{build}), {}{lockstep}{predict}, {}, {}",
            self.device.backend,
            self.device.adapter,
            self.update.name(),
            self.method[0],
            self.method[1],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::BackendName;
    use crate::choose::Ahead;
    use backend::{Hits, Query, QueryKind, Rays};
    use pipeline::{Frame, Pace, Wanted};

    fn frames(scene: &scene::Scene, update: Update, threads: usize, ahead: Ahead) -> Vec<Hits> {
        let ask = Ask {
            backend: BackendName::Cpu,
            adapter: None,
            threads: Some(threads),
            builder_threads: None,
            method: MethodArgs {
                intersector: IntersectorName::Auto,
                layout: LayoutName::Auto,
            },
            update: choose::asked(update),
            tolerance: 0.0,
            run: None,
            rays: 0,
            ahead,
        };
        let mut session = start(&scene.animation, &ask).unwrap();
        let view = output::frame_scene(&scene.animation, 40.0, [48, 27]);
        let camera = view.camera([48, 27]).unwrap();
        let query = Query {
            rays: Rays::Camera(&camera),
            kind: QueryKind::ClosestAndShadow { light: view.light },
        };
        let todo = (0..6).map(|index| Frame {
            index,
            time: index as f64 * 1.7,
        });
        let mut all = Vec::new();
        let run = session.driver.run::<Stop>(
            todo,
            query,
            Wanted {
                hits: true,
                pixels: false,
            },
            |frame, found| {
                assert!(frame.report.times.interpolate_ms.is_some(), "{update:?}");
                all.push(found.hits.clone());
                Ok(())
            },
        );
        run.unwrap();
        all
    }

    #[test]
    fn no_policy_and_no_number_of_threads_changes_what_is_hit() {
        let scene = scene::open("demo:collide:600", &scene::Options::default()).unwrap();
        let want = frames(&scene, Update::Rebuild, 1, Ahead::default());
        assert!(want.iter().all(|h| h.closest.iter().any(geom::Hit::is_hit)));
        assert!(want[0] != want[5]);
        let paces = [
            Pace::Free,
            Pace::Lockstep(0),
            Pace::Lockstep(1),
            Pace::Lockstep(3),
        ];
        let once = [Update::Refit, Update::TSah];
        for update in paces.map(Update::Async).into_iter().chain(once) {
            for predict in [true, false] {
                let time_range = [0.0, 8.5];
                let ahead = Ahead {
                    time_range,
                    predict,
                };
                let found = frames(&scene, update, 2, ahead);
                assert!(found == want, "{update:?} {predict}");
            }
        }
    }
}
