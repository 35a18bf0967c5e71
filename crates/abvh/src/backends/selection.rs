//! Selects a backend automatically.
//!
//! Prefers a GPU, then the host's cores, then a driver that runs shaders on these cores. Backends are listed and opened
//! only when their turn comes, because both take time.

use super::adapters::match_adapter;
use super::{BACKENDS, BackendEntry};
use backend::{AdapterInfo, Backend, BackendError, DeviceKind};
use std::cell::OnceCell;
use std::fmt::Display;

/// Kinds of devices, best first.
const PREFERENCE: [DeviceKind; 3] = [DeviceKind::Gpu, DeviceKind::Cpu, DeviceKind::Software];

/// Error of a selection: no backend was selected.
#[derive(Debug)]
pub struct NoBackend<E> {
    /// Reason, in one line.
    pub reason: String,
    /// Error of the backend that was opened last, if any.
    pub last_error: Option<E>,
}

/// Opens the best backend for which `prepare` succeeds. Returns its result, and the reason for the selection in one
/// line.
///
/// `adapter` is an index or part of a name, if an adapter is requested. Backends that compute on the host use `threads`
/// threads.
///
/// # Errors
/// No backend works, or the adapter name matches no adapter, or several of one backend.
pub fn open_best<T, E: From<BackendError> + Display>(
    adapter: Option<&str>,
    threads: usize,
    prepare: impl Fn(Box<dyn Backend>) -> Result<T, E>,
) -> Result<(T, String), NoBackend<E>> {
    let selection = Selection::new(BACKENDS.iter().collect(), adapter);
    selection.open_first(threads, prepare)
}

/// A selection in progress.
struct Selection<'s> {
    backends: Vec<&'s BackendEntry<'s>>,
    /// Index of the requested adapter, or part of its name.
    requested: Option<&'s str>,
    /// Adapters of each backend, once they are listed.
    lists: Vec<OnceCell<backend::Result<Vec<AdapterInfo>>>>,
    /// Reasons why other backends and adapters were not selected.
    rejections: Vec<String>,
}

impl<'s> Selection<'s> {
    fn new(backends: Vec<&'s BackendEntry<'s>>, requested: Option<&'s str>) -> Self {
        Self {
            lists: backends.iter().map(|_| OnceCell::new()).collect(),
            backends,
            requested,
            rejections: Vec::new(),
        }
    }

    /// Opens the first backend, in order of preference, for which `prepare` succeeds.
    fn open_first<T, E: From<BackendError> + Display>(
        mut self,
        threads: usize,
        prepare: impl Fn(Box<dyn Backend>) -> Result<T, E>,
    ) -> Result<(T, String), NoBackend<E>> {
        let mut last_error = None;
        let count = self.backends.len();
        let order = PREFERENCE.map(|kind| (0..count).map(move |i| (kind, i)));
        for (kind, i) in order.into_iter().flatten() {
            let entry = self.backends[i];
            let adapters = self.adapters(i, kind).map_err(|reason| NoBackend {
                reason,
                last_error: None,
            })?;
            for adapter in adapters {
                let opened = (entry.open)(Some(adapter.index), threads);
                let e = match opened.map_err(E::from).and_then(&prepare) {
                    Ok(value) => return Ok((value, self.reason_for(entry, &adapter))),
                    Err(e) => e,
                };
                self.reject(format!("{} on {}: {e}", entry.name, adapter.name));
                last_error = Some(e);
            }
        }
        Err(self.failure(last_error))
    }

    /// Returns the adapters of backend `i` that have this kind and match the request.
    fn adapters(&mut self, i: usize, kind: DeviceKind) -> Result<Vec<AdapterInfo>, String> {
        let entry = self.backends[i];
        let is_gpu = kind == DeviceKind::Gpu;
        if !entry.kinds.contains(&kind) || (is_gpu && self.is_covered(entry)) {
            return Ok(Vec::new());
        }
        let list = match self.lists[i].get_or_init(|| entry.adapters()) {
            Ok(list) => list,
            Err(e) => {
                let reason = format!("{} cannot run: {e}", entry.name);
                self.reject(reason);
                return Ok(Vec::new());
            }
        };
        let mut matches = match self.requested {
            None => list.clone(),
            Some(requested) => {
                let found = match_adapter(entry.name.name(), list, requested)?;
                found.cloned().into_iter().collect()
            }
        };
        if is_gpu && self.requested.is_none() && matches.iter().all(|a| a.kind != kind) {
            let names: Vec<_> = matches.iter().map(|a| a.name.as_str()).collect();
            let only = format!("only {} on the host's cores", names.join(" and "));
            self.reject(format!("{} finds no GPU but {only}", entry.name));
        }
        matches.retain(|a| a.kind == kind);
        Ok(matches)
    }

    /// Returns whether this backend can have no GPU, because the backend that covers it was listed and found none.
    fn is_covered(&self, entry: &BackendEntry<'_>) -> bool {
        let position = |name| self.backends.iter().position(|r| r.name == name);
        let other = entry.covered_by.and_then(position);
        match other.and_then(|i| self.lists[i].get()) {
            Some(Ok(list)) => list.iter().all(|a| a.kind != DeviceKind::Gpu),
            Some(Err(_)) => true,
            None => false,
        }
    }

    fn reject(&mut self, reason: String) {
        if !self.rejections.contains(&reason) {
            self.rejections.push(reason);
        }
    }

    /// Returns the reason for selecting an adapter.
    fn reason_for(self, entry: &BackendEntry<'_>, adapter: &AdapterInfo) -> String {
        let (name, rank) = (&adapter.name, entry.rank_reason);
        let own = match (self.requested, adapter.kind) {
            (Some(requested), _) => Some(format!("'{requested}' is {name}")),
            (None, DeviceKind::Gpu) => Some(format!("{name} is a GPU; {rank}")),
            // The reasons against other backends suffice, if there are any.
            (None, _) if self.rejections.is_empty() => Some(rank.to_owned()),
            (None, _) => None,
        };
        let all: Vec<_> = own.into_iter().chain(self.rejections).collect();
        all.join("; ")
    }

    /// Returns the error that no backend was selected.
    fn failure<E: Display>(mut self, last_error: Option<E>) -> NoBackend<E> {
        if let Some(e) = &last_error {
            let reason = match self.rejections.len() {
                1 => e.to_string(),
                _ => self.rejections.join("; "),
            };
            return NoBackend { reason, last_error };
        }
        let present: Vec<_> = (self.backends.iter().zip(&self.lists))
            .filter_map(|(entry, list)| {
                let list = list.get()?.as_ref().ok()?;
                Some(format!("{} {}", entry.name, AdapterInfo::numbered(list)))
            })
            .collect();
        if let Some(requested) = self.requested.filter(|_| !present.is_empty()) {
            let other = if self.rejections.is_empty() {
                ""
            } else {
                "other "
            };
            let none = format!("no {other}backend has an adapter '{requested}'");
            self.reject(format!("{none}; there is {}", present.join(", ")));
        }
        NoBackend {
            reason: self.rejections.join("; "),
            last_error,
        }
    }
}

#[cfg(test)]
mod tests;
