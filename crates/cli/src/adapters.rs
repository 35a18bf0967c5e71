//! Adapters: what is told of one, and which one is meant.

use crate::stop::Stop;
use backend::DeviceKind;
pub(crate) use gpu_vulkan::AdapterInfo as Adapter;
use serde::Serializer;
use serde_json::json;

pub(crate) fn kind_name(kind: DeviceKind) -> &'static str {
    match kind {
        DeviceKind::Gpu => "gpu",
        DeviceKind::Cpu => "cpu",
        DeviceKind::Software => "software",
    }
}

/// As JSON tells of them.
pub(crate) fn serialize<S: Serializer>(all: &[Adapter], to: S) -> Result<S::Ok, S::Error> {
    let limit = |(name, value): &(_, _)| json!({ "name": name, "value": value });
    to.collect_seq(all.iter().map(|adapter| {
        json!({
            "index": adapter.index,
            "name": adapter.name,
            "driver": adapter.driver,
            "kind": kind_name(adapter.kind),
            "limits": adapter.limits.iter().map(limit).collect::<Vec<_>>(),
        })
    }))
}

/// The adapter meant by an index, a whole name, or a part of one that no other name has.
/// Case does not matter. `None` if nothing fits.
///
/// # Errors
/// Several fit; the message lists them.
pub(crate) fn find<'a>(
    backend: &str,
    list: &'a [Adapter],
    asked: &str,
) -> Result<Option<&'a Adapter>, Stop> {
    if let Some(adapter) = asked.parse().ok().and_then(|i: usize| list.get(i)) {
        return Ok(Some(adapter));
    }
    let asked_lower = asked.to_lowercase();
    let those = |fits: fn(&str, &str) -> bool| -> Vec<&Adapter> {
        let fits = |a: &&Adapter| fits(&a.name.to_lowercase(), &asked_lower);
        list.iter().filter(fits).collect()
    };
    let mut fits = those(|name, asked| name == asked);
    if fits.is_empty() {
        fits = those(|name, asked| name.contains(asked));
    }
    match fits.as_slice() {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        several => Err(Stop::bad(format!(
            "'{asked}' fits several adapters of backend {backend}; give an index: {}",
            numbered(several.iter().copied())
        ))),
    }
}

/// Likewise, where nothing that fits is an error.
pub(crate) fn find_one<'a>(
    backend: &str,
    list: &'a [Adapter],
    asked: &str,
) -> Result<&'a Adapter, Stop> {
    let none = format!("backend {backend} has no adapter '{asked}'");
    let there = || Stop::bad(format!("{none}; there is {}", numbered(list)));
    find(backend, list, asked)?.ok_or_else(there)
}

pub(crate) fn numbered<'a>(list: impl IntoIterator<Item = &'a Adapter>) -> String {
    let each = list.into_iter().map(|a| format!("{}: {}", a.index, a.name));
    each.collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
pub(crate) fn named(names: &[(&str, DeviceKind)]) -> Vec<Adapter> {
    let each = names.iter().enumerate();
    each.map(|(index, &(name, kind))| Adapter {
        index,
        name: name.to_owned(),
        driver: String::new(),
        kind,
        limits: Vec::new(),
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cards() -> Vec<Adapter> {
        let names = ["Card 4090", "Card 4090 Laptop", "Chip", "Twin", "Twin"];
        named(&names.map(|n| (n, DeviceKind::Gpu)))
    }

    fn index(asked: &str) -> usize {
        find_one("b", &cards(), asked).unwrap().index
    }

    fn refused(asked: &str) -> String {
        find_one("b", &cards(), asked).unwrap_err().to_string()
    }

    #[test]
    fn an_index_a_whole_name_or_part_of_one_name_finds_an_adapter() {
        assert_eq!(["0", "4", "chip", "LAP"].map(index), [0, 4, 2, 1]);
        assert_eq!(index("card 4090"), 0, "the whole name wins over a part");
        // Digits beyond the list may still be part of a name.
        let list = &cards()[..1];
        assert_eq!(find_one("b", list, "4090").unwrap().index, 0);
    }

    #[test]
    fn what_fits_several_lists_them_and_what_fits_none_lists_all() {
        assert_eq!(
            refused("card"),
            "'card' fits several adapters of backend b; give an index: 0: Card 4090; 1: Card 4090 Laptop"
        );
        assert!(refused("twin").ends_with("3: Twin; 4: Twin"));
        for none in ["5", "voodoo"] {
            let text = refused(none);
            let says = format!("backend b has no adapter '{none}'; there is 0: Card 4090; 1:");
            assert!(text.starts_with(&says), "{text}");
            assert!(text.ends_with("4: Twin"), "{text}");
        }
    }
}
