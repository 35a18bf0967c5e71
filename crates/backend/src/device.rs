//! Who does the work, and who else could.

use crate::{BackendError, Result};
use std::fmt;

crate::named! {
    /// What kind of machine does the work.
    pub enum DeviceKind {
        /// A graphics processor.
        Gpu = "gpu",
        /// The host's own cores, by this program's code.
        Cpu = "cpu",
        /// A driver that runs graphics code on the host's cores.
        Software = "software",
    }
}

/// How a device computes where nobody tells it how to round, as the textbook intersectors do not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arithmetic {
    /// Whether a quotient is the nearest number to the exact one.
    pub rounds_division: bool,
    /// Whether products are added up without being rounded first, anywhere.
    pub fuses: bool,
}

impl Arithmetic {
    /// Every operation rounded once, as IEEE 754 has it: the host's.
    pub const IEEE: Self = Self {
        rounds_division: true,
        fuses: false,
    };
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.rounds_division, self.fuses) {
            (true, false) => "every operation rounded once",
            (true, true) => "quotients rounded once, products fused",
            (false, false) => "quotients approximate, products rounded once",
            (false, true) => "quotients approximate, products fused",
        })
    }
}

/// Who is at work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// The backend's name on the command line, such as `cpu`.
    pub backend: &'static str,
    /// The device's own name.
    pub adapter: String,
    /// Driver and version; empty where there is none.
    pub driver: String,
    /// What kind of machine it is.
    pub kind: DeviceKind,
    /// Host threads the backend computes on; 0 if its device does.
    pub threads: usize,
    /// How it computes where nobody tells it how to round.
    pub arithmetic: Arithmetic,
}

/// Bytes of device memory by what they hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// The tree and the triangles' records: all that is there to be traced or refitted. Where a tree is handed over while
    /// frames read another, both.
    pub tree: u64,
    /// Room in which trees are made, or wait to be sent.
    pub scratch: u64,
    /// The scene itself: key frames, positions, which vertices are a triangle's.
    pub scene: u64,
    /// What frames need and leave: rays, hits, shadows, what is seen of a picture, counts, parameters.
    pub frames: u64,
}

impl DeviceBytes {
    /// All of it.
    pub fn total(self) -> u64 {
        self.tree + self.scratch + self.scene + self.frames
    }
}

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
        let adapter = |index, name: &str, kind| AdapterInfo {
            index,
            name: name.to_owned(),
            driver: String::new(),
            kind,
            limits: Vec::new(),
        };
        let list = [
            adapter(0, "llvmpipe", DeviceKind::Software),
            adapter(1, "card", DeviceKind::Gpu),
        ];
        assert_eq!(AdapterInfo::choose(&list, None), Ok(&list[1]));
        assert_eq!(AdapterInfo::choose(&list[..1], None), Ok(&list[0]));
        assert_eq!(AdapterInfo::choose(&list, Some(0)), Ok(&list[0]));
        // A part of all has the numbers of all.
        assert_eq!(AdapterInfo::choose(&list[1..], Some(1)), Ok(&list[1]));
        let refused = AdapterInfo::choose(&list, Some(9)).unwrap_err().to_string();
        assert!(refused.ends_with("0: llvmpipe; 1: card"), "{refused}");
    }
}
