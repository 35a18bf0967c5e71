//! Selects a backend automatically.
//!
//! A GPU is preferred to the host's cores, and these to a driver that runs shaders on the same cores. Backends are
//! listed and opened only when their turn comes, because both take time.

use crate::adapters::find;
use crate::{KNOWN, Known};
use backend::{AdapterInfo, Backend, BackendError, DeviceKind};
use std::cell::OnceCell;
use std::fmt::Display;

/// Kinds of devices, best first.
const PREFERENCE: [DeviceKind; 3] = [DeviceKind::Gpu, DeviceKind::Cpu, DeviceKind::Software];

/// Error of a selection: no backend was selected.
#[derive(Debug)]
pub struct Vain<E> {
    /// Reason, in one line.
    pub why: String,
    /// Error of the backend that was opened last, if any.
    pub broken: Option<E>,
}

/// Opens the best backend for which `ready` succeeds. Returns its result, and the reason for the selection in one line.
///
/// `on` is an adapter, by index or part of its name, if one is requested, and the number of host threads for backends
/// that compute on the host.
///
/// # Errors
/// No backend works, or the adapter name matches no adapter, or several of one backend.
pub fn open_best<T, E: From<BackendError> + Display>(
    on: (Option<&str>, usize),
    ready: impl Fn(Box<dyn Backend>) -> Result<T, E>,
) -> Result<(T, String), Vain<E>> {
    take(&KNOWN.iter().collect::<Vec<_>>(), on, ready)
}

/// Opens the best backend of `known`.
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
    /// Reasons why other backends and adapters were not selected.
    passed: Vec<String>,
}

impl Search<'_> {
    /// Returns the adapters of backend `i` that have this kind and match the request.
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
                let found = find(rival.name.name(), list, asked)?;
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

    /// Returns whether a backend that finds all GPUs of this backend was listed and has no GPU.
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

    /// Returns the reason for selecting an adapter.
    fn why(self, rival: &Known<'_>, adapter: &AdapterInfo) -> String {
        let because = match (self.asked, adapter.kind) {
            (Some(asked), _) => Some(format!("'{asked}' is {}", adapter.name)),
            (None, DeviceKind::Gpu) => Some(format!("{} is a GPU; {}", adapter.name, rival.place)),
            // The reasons against other backends suffice, if there are any.
            (None, _) if self.passed.is_empty() => Some(rival.place.to_owned()),
            (None, _) => None,
        };
        let all = because.into_iter().chain(self.passed);
        all.collect::<Vec<_>>().join("; ")
    }

    /// Returns the error that no backend was selected. `broken` is the error of the backend that was opened last.
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
