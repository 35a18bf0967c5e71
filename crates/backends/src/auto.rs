//! Which backend is taken if none is named: a pure choice over what is offered.
//!
//! A GPU comes before the host's cores, and those before a driver that runs graphics code on the same cores. Nothing is
//! listed or opened before its turn, for both take time.

use crate::adapters::find;
use crate::{KNOWN, Known};
use backend::{AdapterInfo, Backend, BackendError, DeviceKind};
use std::cell::OnceCell;
use std::fmt::Display;

/// Better kinds first.
const PREFERENCE: [DeviceKind; 3] = [DeviceKind::Gpu, DeviceKind::Cpu, DeviceKind::Software];

/// Why nothing was taken.
#[derive(Debug)]
pub struct Vain<E> {
    /// In one line.
    pub why: String,
    /// What came of the last backend that was opened.
    pub broken: Option<E>,
}

/// Takes the best backend that can be made ready, on the adapter that is asked for by an index or by part of its name if one
/// is, with so many host threads if it computes on them; says why in one line.
///
/// # Errors
/// Nothing works, or the name means several adapters of one backend, or none.
pub fn open_best<T, E: From<BackendError> + Display>(
    on: (Option<&str>, usize),
    ready: impl Fn(Box<dyn Backend>) -> Result<T, E>,
) -> Result<(T, String), Vain<E>> {
    take(&KNOWN.iter().collect::<Vec<_>>(), on, ready)
}

/// Takes the best of `known`.
fn take<T, E: From<BackendError> + Display>(
    known: &[&Known<'_>],
    (asked, threads): (Option<&str>, usize),
    ready: impl Fn(Box<dyn Backend>) -> Result<T, E>,
) -> Result<(T, String), Vain<E>> {
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
            let fits = search
                .fits(i, kind)
                .map_err(|why| Vain { why, broken: None })?;
            for adapter in fits {
                let opened = (rival.open)(Some(adapter.index), threads);
                match opened.map_err(E::from).and_then(&ready) {
                    Ok(value) => return Ok((value, search.why(rival, &adapter))),
                    Err(e) => {
                        search.pass(format!("{} on {}: {e}", rival.name, adapter.name));
                        broken = Some(e);
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
    lists: Vec<OnceCell<backend::Result<Vec<AdapterInfo>>>>,
    /// Why others were passed over.
    passed: Vec<String>,
}

impl Search<'_> {
    /// One backend's adapters of one kind that may be taken.
    fn fits(&mut self, i: usize, kind: DeviceKind) -> Result<Vec<AdapterInfo>, String> {
        let rival = self.known[i];
        if kind == DeviceKind::Gpu && self.is_covered(rival) {
            return Ok(Vec::new());
        }
        let list = match self.lists[i].get_or_init(|| rival.adapters()) {
            Ok(list) => list,
            Err(e) => {
                let why = format!("{} cannot run: {e}", rival.name);
                self.pass(why);
                return Ok(Vec::new());
            }
        };
        let mut fits = match self.asked {
            None => list.clone(),
            Some(asked) => {
                let found = find(rival.name, list, asked)?;
                found.cloned().into_iter().collect()
            }
        };
        if kind == DeviceKind::Gpu && self.asked.is_none() && fits.iter().all(|a| a.kind != kind) {
            let names: Vec<_> = fits.iter().map(|a| a.name.as_str()).collect();
            let only = format!("only {} on the host's cores", names.join(" and "));
            self.pass(format!("{} finds no GPU but {only}", rival.name));
        }
        fits.retain(|a| a.kind == kind);
        Ok(fits)
    }

    /// Whether another was listed that would have found this one's GPUs, and found none.
    fn is_covered(&self, rival: &Known<'_>) -> bool {
        let by = |name| self.known.iter().position(|r| r.name == name);
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
    fn why(self, rival: &Known<'_>, adapter: &AdapterInfo) -> String {
        let because = match (self.asked, adapter.kind) {
            (Some(asked), _) => Some(format!("'{asked}' is {}", adapter.name)),
            (None, DeviceKind::Gpu) => Some(format!("{} is a GPU; {}", adapter.name, rival.place)),
            // What was passed over says it all, unless there was nothing.
            (None, _) if self.passed.is_empty() => Some(rival.place.to_owned()),
            (None, _) => None,
        };
        let all = because.into_iter().chain(self.passed);
        all.collect::<Vec<_>>().join("; ")
    }

    /// Why nothing was taken; `broken` is what came of the last that was opened.
    fn in_vain<E: Display>(mut self, broken: Option<E>) -> Vain<E> {
        if let Some(e) = &broken {
            let why = match self.passed.len() {
                1 => e.to_string(),
                _ => self.passed.join("; "),
            };
            return Vain { why, broken };
        }
        let there: Vec<_> = (self.known.iter().zip(&self.lists))
            .filter_map(|(rival, list)| {
                let list = list.get()?.as_ref().ok()?;
                Some(format!("{} {}", rival.name, AdapterInfo::numbered(list)))
            })
            .collect();
        if let Some(asked) = self.asked.filter(|_| !there.is_empty()) {
            let other = if self.passed.is_empty() { "" } else { "other " };
            let none = format!("no {other}backend has an adapter '{asked}'");
            self.pass(format!("{none}; there is {}", there.join(", ")));
        }
        let why = self.passed.join("; ");
        Vain { why, broken }
    }
}

#[cfg(test)]
mod tests;
