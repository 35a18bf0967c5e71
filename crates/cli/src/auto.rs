//! Which backend `auto` takes: a pure choice over what is offered.
//!
//! A GPU comes before the host's cores, and those before a driver that runs
//! graphics code on the same cores. Nothing is listed or opened before its
//! turn, for both take time.

use crate::adapters::{self, Adapter};
use crate::stop::Stop;
use backend::DeviceKind;
use std::cell::OnceCell;

/// Better kinds first.
const PREFERENCE: [DeviceKind; 3] = [DeviceKind::Gpu, DeviceKind::Cpu, DeviceKind::Software];

/// What is said of a GPU whose driver answers ray queries. It is never taken unasked, for `auto` must not change a hit.
const BY_NAME: &str = "its driver traces too: where hardware does that, --backend vulkan-rt is the faster choice, to be \
     asked for by name since what it hits is the driver's affair";

/// Lists a backend's adapters.
pub(crate) type List<'a> = Box<dyn Fn() -> backend::Result<Vec<Adapter>> + 'a>;
/// Opens an adapter and readies it for the scene.
pub(crate) type Open<'a, T> = Box<dyn Fn(&Adapter) -> Result<T, Stop> + 'a>;

/// A backend as the choice sees it. Among those of one kind the first that works is taken.
pub(crate) struct Rival<'a, T> {
    /// Its name on the command line.
    pub(crate) name: &'static str,
    /// Why it has this place among the others.
    pub(crate) place: &'static str,
    /// What kinds of adapters it may offer.
    pub(crate) kinds: &'static [DeviceKind],
    /// The rival that finds every GPU which this one could find.
    pub(crate) covered_by: Option<&'static str>,
    /// What it lacks of the method asked for.
    pub(crate) lacks: Option<String>,
    /// Whether an adapter's driver answers ray queries, which hardware may do.
    pub(crate) answers_rays: Box<dyn Fn(&Adapter) -> bool + 'a>,
    /// What it offers.
    pub(crate) list: List<'a>,
    /// Makes use of an offer.
    pub(crate) open: Open<'a, T>,
}

/// Takes the best that works, among the adapters that `asked` means if it is given; says why in one line.
///
/// # Errors
/// Nothing works, or `asked` means several adapters of one backend, or none.
pub(crate) fn take<T>(rivals: &[Rival<'_, T>], asked: Option<&str>) -> Result<(T, String), Stop> {
    let mut search = Search {
        rivals,
        asked,
        lists: rivals.iter().map(|_| OnceCell::new()).collect(),
        passed: Vec::new(),
        broken: None,
    };
    for kind in PREFERENCE {
        for (i, rival) in rivals.iter().enumerate() {
            if rival.kinds.contains(&kind)
                && let Some(taken) = search.visit(i, kind)?
            {
                return Ok(taken);
            }
        }
    }
    Err(search.in_vain())
}

struct Search<'s, 'a, T> {
    rivals: &'s [Rival<'a, T>],
    asked: Option<&'s str>,
    lists: Vec<OnceCell<backend::Result<Vec<Adapter>>>>,
    /// Why others were passed over.
    passed: Vec<String>,
    /// The last that was opened in vain.
    broken: Option<Stop>,
}

impl<T> Search<'_, '_, T> {
    /// Tries one backend's adapters of one kind.
    fn visit(&mut self, i: usize, kind: DeviceKind) -> Result<Option<(T, String)>, Stop> {
        let rival = &self.rivals[i];
        if let Some(what) = &rival.lacks {
            self.pass(format!("{} does not support {what}", rival.name));
            return Ok(None);
        }
        if kind == DeviceKind::Gpu && self.is_covered(rival) {
            return Ok(None);
        }
        let fits = match self.fits(i)? {
            Ok(fits) => fits,
            Err(why) => {
                self.pass(format!("{} cannot run: {why}", rival.name));
                return Ok(None);
            }
        };
        for adapter in fits.iter().filter(|a| a.kind == kind) {
            match (rival.open)(adapter) {
                Ok(value) => return Ok(Some((value, self.why(rival, adapter)))),
                Err(stop) => {
                    self.pass(format!(
                        "{} on {}: {}",
                        rival.name,
                        adapter.name,
                        stop.text()
                    ));
                    self.broken = Some(stop);
                }
            }
        }
        if kind == DeviceKind::Gpu && self.asked.is_none() && fits.iter().all(|a| a.kind != kind) {
            let names: Vec<_> = fits.iter().map(|a| a.name.as_str()).collect();
            let (name, only) = (rival.name, names.join(" and "));
            self.pass(format!(
                "{name} finds no GPU but only {only} on the host's cores"
            ));
        }
        Ok(None)
    }

    /// Whether another was listed that would have found this one's GPUs, and found none.
    fn is_covered(&self, rival: &Rival<'_, T>) -> bool {
        let by = |name| self.rivals.iter().position(|r| r.name == name);
        let listed = rival.covered_by.and_then(by).map(|i| self.lists[i].get());
        match listed.flatten() {
            Some(Ok(list)) => list.iter().all(|a| a.kind != DeviceKind::Gpu),
            Some(Err(_)) => true,
            None => false,
        }
    }

    /// The adapters of a backend that may be taken, or why there are none.
    fn fits(&self, i: usize) -> Result<Result<Vec<Adapter>, String>, Stop> {
        let list = match self.lists[i].get_or_init(|| (self.rivals[i].list)()) {
            Ok(list) => list,
            Err(e) => return Ok(Err(e.to_string())),
        };
        Ok(Ok(match self.asked {
            None => list.clone(),
            Some(asked) => {
                let found = adapters::find(self.rivals[i].name, list, asked)?;
                found.cloned().into_iter().collect()
            }
        }))
    }

    fn pass(&mut self, why: String) {
        if !self.passed.contains(&why) {
            self.passed.push(why);
        }
    }

    /// Why an adapter was taken.
    fn why(&self, rival: &Rival<'_, T>, adapter: &Adapter) -> String {
        let because = match (self.asked, adapter.kind) {
            (Some(asked), _) => Some(format!("'{asked}' is {}", adapter.name)),
            (None, DeviceKind::Gpu) => Some(format!("{} is a GPU; {}", adapter.name, rival.place)),
            // What was passed over says it all, unless there was nothing.
            (None, _) if self.passed.is_empty() => Some(rival.place.to_owned()),
            (None, _) => None,
        };
        let by_name = adapter.kind == DeviceKind::Gpu && (rival.answers_rays)(adapter);
        let by_name = by_name.then(|| BY_NAME.to_owned());
        let all: Vec<_> = because.into_iter().chain(by_name).collect();
        [all, self.passed.clone()].concat().join("; ")
    }

    /// Why nothing was taken.
    fn in_vain(mut self) -> Stop {
        match self.broken.take() {
            Some(broken) if self.passed.len() == 1 => return broken,
            Some(Stop::Failed(_)) => return Stop::failed(self.passed.join("; ")),
            Some(_) => return Stop::bad(self.passed.join("; ")),
            None => {}
        }
        let there: Vec<_> = (self.rivals.iter().zip(&self.lists))
            .filter_map(|(rival, list)| {
                let list = list.get()?.as_ref().ok()?;
                Some(format!("{} {}", rival.name, adapters::numbered(list)))
            })
            .collect();
        if let Some(asked) = self.asked.filter(|_| !there.is_empty()) {
            let other = if self.passed.is_empty() { "" } else { "other " };
            let there = there.join(", ");
            self.pass(format!(
                "no {other}backend has an adapter '{asked}'; there is {there}"
            ));
        }
        Stop::bad(self.passed.join("; "))
    }
}

#[cfg(test)]
mod tests;
