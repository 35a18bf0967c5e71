//! Which backend `auto` takes: a pure choice over what is offered.
//!
//! A GPU comes before the host's cores, and those before a driver that runs
//! graphics code on the same cores. Nothing is listed or opened before its
//! turn, for both take time.

use super::Known;
use crate::adapters::{self, Adapter};
use crate::stop::Stop;
use backend::{Backend, DeviceKind};
use std::cell::OnceCell;

/// Better kinds first.
const PREFERENCE: [DeviceKind; 3] = [DeviceKind::Gpu, DeviceKind::Cpu, DeviceKind::Software];

/// What is said of a GPU whose driver answers ray queries. It is never taken unasked, for `auto` must not change a hit.
const BY_NAME: &str = "its driver traces too: where hardware does that, --backend vulkan-rt is the faster choice, to be \
     asked for by name since what it hits is the driver's affair";

/// Takes the best of `known` that can be made ready, on the adapter that is asked for if one is; says why in one
/// line. `traces` says whether an adapter's driver answers ray queries, which hardware may do.
///
/// # Errors
/// Nothing works, or the name means several adapters of one backend, or none.
pub(super) fn take<T>(
    known: &[&Known<'_>],
    (asked, threads): (Option<&str>, usize),
    traces: &dyn Fn(&Adapter) -> bool,
    ready: impl Fn(Box<dyn Backend>) -> Result<T, Stop>,
) -> Result<(T, String), Stop> {
    let mut search = Search {
        known,
        asked,
        lists: known.iter().map(|_| OnceCell::new()).collect(),
        passed: Vec::new(),
    };
    let mut broken = None;
    for kind in PREFERENCE {
        for (i, rival) in known.iter().enumerate() {
            if !rival.kinds.contains(&kind) {
                continue;
            }
            for adapter in search.fits(i, kind)? {
                let opened = (rival.open)(Some(&adapter), threads);
                match opened.map_err(Stop::from).and_then(&ready) {
                    Ok(value) => return Ok((value, search.why(rival, &adapter, traces))),
                    Err(stop) => {
                        let (name, adapter) = (rival.text, &adapter.name);
                        search.pass(format!("{name} on {adapter}: {}", stop));
                        broken = Some(stop);
                    }
                }
            }
        }
    }
    Err(search.in_vain(broken))
}

struct Search<'s> {
    known: &'s [&'s Known<'s>],
    asked: Option<&'s str>,
    lists: Vec<OnceCell<backend::Result<Vec<Adapter>>>>,
    /// Why others were passed over.
    passed: Vec<String>,
}

impl Search<'_> {
    /// One backend's adapters of one kind that may be taken.
    fn fits(&mut self, i: usize, kind: DeviceKind) -> Result<Vec<Adapter>, Stop> {
        let rival = self.known[i];
        if kind == DeviceKind::Gpu && self.is_covered(rival) {
            return Ok(Vec::new());
        }
        let list = match self.lists[i].get_or_init(|| (rival.list)()) {
            Ok(list) => list,
            Err(e) => {
                let why = format!("{} cannot run: {e}", rival.text);
                self.pass(why);
                return Ok(Vec::new());
            }
        };
        let mut fits = match self.asked {
            None => list.clone(),
            Some(asked) => {
                let found = adapters::find(rival.text, list, asked)?;
                found.cloned().into_iter().collect()
            }
        };
        if kind == DeviceKind::Gpu && self.asked.is_none() && fits.iter().all(|a| a.kind != kind) {
            let names: Vec<_> = fits.iter().map(|a| a.name.as_str()).collect();
            let only = format!("only {} on the host's cores", names.join(" and "));
            self.pass(format!("{} finds no GPU but {only}", rival.text));
        }
        fits.retain(|a| a.kind == kind);
        Ok(fits)
    }

    /// Whether another was listed that would have found this one's GPUs, and found none.
    fn is_covered(&self, rival: &Known<'_>) -> bool {
        let by = |name| self.known.iter().position(|r| r.text == name);
        let listed = rival.covered_by.and_then(by).map(|i| self.lists[i].get());
        match listed.flatten() {
            Some(Ok(list)) => list.iter().all(|a| a.kind != DeviceKind::Gpu),
            Some(Err(_)) => true,
            None => false,
        }
    }

    fn pass(&mut self, why: String) {
        if !self.passed.contains(&why) {
            self.passed.push(why);
        }
    }

    /// Why an adapter was taken.
    fn why(
        self,
        rival: &Known<'_>,
        adapter: &Adapter,
        traces: &dyn Fn(&Adapter) -> bool,
    ) -> String {
        let because = match (self.asked, adapter.kind) {
            (Some(asked), _) => Some(format!("'{asked}' is {}", adapter.name)),
            (None, DeviceKind::Gpu) => Some(format!("{} is a GPU; {}", adapter.name, rival.place)),
            // What was passed over says it all, unless there was nothing.
            (None, _) if self.passed.is_empty() => Some(rival.place.to_owned()),
            (None, _) => None,
        };
        let by_name = adapter.kind == DeviceKind::Gpu && traces(adapter);
        let by_name = by_name.then(|| BY_NAME.to_owned());
        let all = because.into_iter().chain(by_name).chain(self.passed);
        all.collect::<Vec<_>>().join("; ")
    }

    /// Why nothing was taken; `broken` is what came of the last that was opened.
    fn in_vain(mut self, broken: Option<Stop>) -> Stop {
        match broken {
            Some(broken) if self.passed.len() == 1 => return broken,
            Some(Stop::Failed(_)) => return Stop::failed(self.passed.join("; ")),
            Some(_) => return Stop::bad(self.passed.join("; ")),
            None => {}
        }
        let there: Vec<_> = (self.known.iter().zip(&self.lists))
            .filter_map(|(rival, list)| {
                let list = list.get()?.as_ref().ok()?;
                Some(format!("{} {}", rival.text, adapters::numbered(list)))
            })
            .collect();
        if let Some(asked) = self.asked.filter(|_| !there.is_empty()) {
            let other = if self.passed.is_empty() { "" } else { "other " };
            let none = format!("no {other}backend has an adapter '{asked}'");
            self.pass(format!("{none}; there is {}", there.join(", ")));
        }
        Stop::bad(self.passed.join("; "))
    }
}

#[cfg(test)]
mod tests;
