//! Selects an adapter by index or name.

use backend::AdapterInfo;

/// Finds an adapter by its index, its whole name, or a part of its name that no other name contains. A string of digits
/// is an index. Case does not matter. Returns `None` if no adapter matches.
///
/// # Errors
/// Several adapters match. The message lists them.
pub(crate) fn find<'a>(
    backend: &str,
    list: &'a [AdapterInfo],
    asked: &str,
) -> Result<Option<&'a AdapterInfo>, String> {
    if !asked.is_empty() && asked.bytes().all(|b| b.is_ascii_digit()) {
        // A number that overflows is not the index of any adapter.
        let index: Option<usize> = asked.parse().ok();
        return Ok(list.iter().find(|a| Some(a.index) == index));
    }
    let asked_lower = asked.to_lowercase();
    let those = |fits: fn(&str, &str) -> bool| -> Vec<&AdapterInfo> {
        let fits = |a: &&AdapterInfo| fits(&a.name.to_lowercase(), &asked_lower);
        list.iter().filter(fits).collect()
    };
    let mut fits = those(|name, asked| name == asked);
    if fits.is_empty() {
        fits = those(|name, asked| name.contains(asked));
    }
    match fits.as_slice() {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        several => Err(format!(
            "'{asked}' fits several adapters of {backend}; give an index: {}",
            AdapterInfo::numbered(several.iter().copied())
        )),
    }
}

/// Finds the adapter of `backend`, or of a rival, that `asked` names by its index, its name or a part of the name.
///
/// # Errors
/// Several adapters fit, or none. The message lists them.
pub fn find_adapter<'a>(
    backend: &str,
    list: &'a [AdapterInfo],
    asked: &str,
) -> Result<&'a AdapterInfo, String> {
    let none = format!("{backend} has no adapter '{asked}'");
    let there = || format!("{none}; there is {}", AdapterInfo::numbered(list));
    find(backend, list, asked)?.ok_or_else(there)
}

#[cfg(test)]
pub(crate) fn named(names: &[(&str, backend::DeviceKind)]) -> Vec<AdapterInfo> {
    let each = names.iter().enumerate();
    each.map(|(index, &(name, kind))| AdapterInfo {
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
    use backend::DeviceKind;

    fn cards() -> Vec<AdapterInfo> {
        let names = ["Card 4090", "Card 4090 Laptop", "Chip", "Twin", "Twin"];
        named(&names.map(|n| (n, DeviceKind::Gpu)))
    }

    fn index(asked: &str) -> usize {
        find_adapter("b", &cards(), asked).unwrap().index
    }

    fn refused(asked: &str) -> String {
        find_adapter("b", &cards(), asked).unwrap_err()
    }

    #[test]
    fn finds_adapters_by_index_or_name() {
        assert_eq!(["0", "4", "chip", "LAP"].map(index), [0, 4, 2, 1]);
        assert_eq!(index("card 4090"), 0, "the whole name wins over a part");
        let list = &cards()[..1];
        assert_eq!(find_adapter("b", list, "d 4090").unwrap().index, 0);
    }

    #[test]
    fn digits_match_indices_only() {
        for digits in ["5", "40", "4090", "99999999999999999999999999"] {
            let said = refused(digits);
            let none = format!("b has no adapter '{digits}'; there is 0: Card 4090;");
            assert!(said.starts_with(&none), "{said}");
        }
    }

    #[test]
    fn errors_list_candidate_adapters() {
        assert_eq!(
            refused("card"),
            "'card' fits several adapters of b; give an index: 0: Card 4090; 1: Card 4090 Laptop"
        );
        assert!(refused("twin").ends_with("3: Twin; 4: Twin"));
        for none in ["5", "voodoo"] {
            let text = refused(none);
            let says = format!("b has no adapter '{none}'; there is 0: Card 4090; 1:");
            assert!(text.starts_with(&says), "{text}");
            assert!(text.ends_with("4: Twin"), "{text}");
        }
    }
}
