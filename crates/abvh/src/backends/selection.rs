//! Selects a backend automatically.
//!
//! Prefers a GPU, then the host's cores, then a driver that runs shaders on these cores. Backends are listed and opened
//! only when their turn comes, because both take time.

use super::adapters::match_adapter;
use super::{BACKENDS, BackendEntry};
use backend::{AdapterInfo, Backend, BackendError, DeviceKind};
use std::fmt::Display;

/// Kinds of devices, best first.
const PREFERENCE: [DeviceKind; 3] = [DeviceKind::Gpu, DeviceKind::Cpu, DeviceKind::Software];

/// Error of a selection: no backend was selected.
#[derive(Debug)]
pub struct NoBackend<E> {
    /// Reason, in one line.
    pub reason: String,
    /// Error of the last attempt to open a backend. `None` without an attempt, or if several adapters match.
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
    open_first(BACKENDS, adapter, threads, prepare)
}

/// Opens the first of `backends`, in order of preference, for which `prepare` succeeds.
fn open_first<T, E: From<BackendError> + Display>(
    backends: &[BackendEntry<'_>],
    adapter: Option<&str>,
    threads: usize,
    prepare: impl Fn(Box<dyn Backend>) -> Result<T, E>,
) -> Result<(T, String), NoBackend<E>> {
    let mut selection = Selection {
        requested: adapter,
        present: Vec::new(),
        rejections: Vec::new(),
    };
    let mut lists: Vec<_> = backends.iter().map(|_| None).collect();
    let mut last_error = None;
    for kind in PREFERENCE {
        let with_kind = backends.iter().zip(&mut lists);
        for (entry, list) in with_kind.filter(|(entry, _)| entry.kinds.contains(&kind)) {
            if list.is_none() {
                *list = Some(selection.adapters(entry).map_err(|reason| NoBackend {
                    reason,
                    last_error: None,
                })?);
            }
            for adapter in list.iter().flatten().filter(|a| a.kind == kind) {
                let opened = (entry.open)(Some(adapter.index), threads);
                let e = match opened.map_err(E::from).and_then(&prepare) {
                    Ok(value) => return Ok((value, selection.reason_for(entry, adapter))),
                    Err(e) => e,
                };
                let (name, adapter) = (entry.name, &adapter.name);
                selection
                    .rejections
                    .push(format!("{name} on {adapter}: {e}"));
                last_error = Some(e);
            }
        }
    }
    Err(selection.failure(last_error))
}

/// A selection in progress.
struct Selection<'s> {
    /// Index of the requested adapter, or part of its name.
    requested: Option<&'s str>,
    /// Backends that were listed, with their adapters.
    present: Vec<String>,
    /// Reasons why other backends and adapters were not selected.
    rejections: Vec<String>,
}

impl Selection<'_> {
    /// Lists the adapters of a backend that match the request.
    fn adapters(&mut self, entry: &BackendEntry<'_>) -> Result<Vec<AdapterInfo>, String> {
        let name = entry.name;
        let list = match entry.adapters() {
            Ok(list) => list,
            Err(e) => {
                self.rejections.push(format!("{name} cannot run: {e}"));
                return Ok(Vec::new());
            }
        };
        let numbered = AdapterInfo::numbered(&list);
        self.present.push(format!("{name} {numbered}"));
        if let Some(requested) = self.requested {
            let found = match_adapter(name.name(), &list, requested)?;
            return Ok(found.cloned().into_iter().collect());
        }
        let is_gpu = |kind: &DeviceKind| *kind == DeviceKind::Gpu;
        if entry.kinds.iter().any(is_gpu) && !list.iter().any(|a| is_gpu(&a.kind)) {
            let names: Vec<_> = list.iter().map(|a| a.name.as_str()).collect();
            let only = format!("only {} on the host's cores", names.join(" and "));
            self.rejections
                .push(format!("{name} finds no GPU but {only}"));
        }
        Ok(list)
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
        if let Some(requested) = self.requested.filter(|_| !self.present.is_empty()) {
            let other = if self.rejections.is_empty() {
                ""
            } else {
                "other "
            };
            let none = format!("no {other}backend has an adapter '{requested}'");
            let present = self.present.join(", ");
            self.rejections.push(format!("{none}; there is {present}"));
        }
        NoBackend {
            reason: self.rejections.join("; "),
            last_error,
        }
    }
}

#[cfg(test)]
mod tests;
