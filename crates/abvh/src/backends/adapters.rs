//! Selects an adapter by index or name.

use backend::AdapterInfo;

/// Finds an adapter by its index, its whole name, or a part of its name that no other name contains. A string of digits
/// is an index. Case does not matter. Returns `None` if no adapter matches.
///
/// # Errors
/// Several adapters match. The message lists them.
pub(super) fn match_adapter<'a>(
    backend: &str,
    list: &'a [AdapterInfo],
    requested: &str,
) -> Result<Option<&'a AdapterInfo>, String> {
    if !requested.is_empty() && requested.bytes().all(|b| b.is_ascii_digit()) {
        // A number that overflows is not the index of any adapter.
        let index: Option<usize> = requested.parse().ok();
        return Ok(list.iter().find(|a| Some(a.index) == index));
    }
    let part = requested.to_lowercase();
    let has_part = |a: &&AdapterInfo| a.name.to_lowercase().contains(&part);
    let is_whole = |a: &&AdapterInfo| a.name.to_lowercase() == part;
    let mut matches: Vec<_> = list.iter().filter(is_whole).collect();
    if matches.is_empty() {
        matches = list.iter().filter(has_part).collect();
    }
    match matches[..] {
        [] => Ok(None),
        [one] => Ok(Some(one)),
        _ => Err(format!(
            "'{requested}' fits several adapters of {backend}; give an index: {}",
            AdapterInfo::numbered(matches)
        )),
    }
}

/// Finds the adapter in `list` that `requested` names by its index, its name or a part of the name. `backend` is the
/// name for error messages.
///
/// # Errors
/// Several adapters match, or none. The message lists them.
pub fn find_adapter<'a>(
    backend: &str,
    list: &'a [AdapterInfo],
    requested: &str,
) -> Result<&'a AdapterInfo, String> {
    match_adapter(backend, list, requested)?.ok_or_else(|| {
        let present = AdapterInfo::numbered(list);
        format!("{backend} has no adapter '{requested}'; there is {present}")
    })
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
    fn errors_list_candidate_adapters() {
        assert_eq!(
            refused("card"),
            "'card' fits several adapters of b; give an index: 0: Card 4090; 1: Card 4090 Laptop"
        );
        assert!(refused("twin").ends_with("3: Twin; 4: Twin"));
        // Digits match indices only.
        for none in ["5", "40", "4090", "99999999999999999999999999", "voodoo"] {
            let text = refused(none);
            let says = format!("b has no adapter '{none}'; there is 0: Card 4090; 1:");
            assert!(text.starts_with(&says), "{text}");
            assert!(text.ends_with("4: Twin"), "{text}");
        }
    }
}
