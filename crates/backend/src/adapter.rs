//! Adapters: what is told of one, and which one is taken.

use crate::{BackendError, DeviceKind, Result};

/// An adapter that a backend offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Its place in the backend's list.
    pub index: usize,
    /// The device's own name.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// What kind of machine it is.
    pub kind: DeviceKind,
    /// What bounds or shapes the work here: names and values, to be shown.
    pub limits: Vec<(&'static str, String)>,
}

impl AdapterInfo {
    /// The one of the index that is wanted; else the first GPU, else the first.
    ///
    /// # Errors
    /// [`BackendError::NoDevice`] if there is no such adapter, with the names of all.
    pub fn choose(list: &[Self], wanted: Option<usize>) -> Result<&Self> {
        let usual = || list.iter().find(|a| a.kind == DeviceKind::Gpu);
        let found = match wanted {
            Some(index) => list.iter().find(|a| a.index == index),
            None => usual().or(list.first()),
        };
        let wanted = wanted.unwrap_or_default();
        let none = || format!("no adapter {wanted} among {}", Self::numbered(list));
        found.ok_or_else(|| BackendError::NoDevice(none()))
    }

    /// Indices and names, to be shown.
    pub fn numbered<'a>(list: impl IntoIterator<Item = &'a Self>) -> String {
        let each = list.into_iter().map(|a| format!("{}: {}", a.index, a.name));
        each.collect::<Vec<_>>().join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_is_chosen_by_index_or_for_being_a_gpu() {
        let kinds = [
            ("llvmpipe", DeviceKind::Software),
            ("card", DeviceKind::Gpu),
        ];
        let adapter = |(index, (name, kind)): (usize, (&str, _))| AdapterInfo {
            index,
            name: name.to_owned(),
            driver: String::new(),
            kind,
            limits: Vec::new(),
        };
        let list: Vec<_> = kinds.into_iter().enumerate().map(adapter).collect();
        assert_eq!(AdapterInfo::choose(&list, None), Ok(&list[1]));
        assert_eq!(AdapterInfo::choose(&list[..1], None), Ok(&list[0]));
        assert_eq!(AdapterInfo::choose(&list, Some(0)), Ok(&list[0]));
        // A part of all has the numbers of all.
        assert_eq!(AdapterInfo::choose(&list[1..], Some(1)), Ok(&list[1]));
        let refused = AdapterInfo::choose(&list, Some(9)).unwrap_err().to_string();
        assert!(refused.ends_with("0: llvmpipe; 1: card"), "{refused}");
    }
}
