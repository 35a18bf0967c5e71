//! Which adapter of several is meant.

use crate::{BackendError, DeviceKind, Result};

/// The place in `list` of the adapter asked for by index or by a part of its name; else of the first GPU, else of the first.
///
/// # Errors
/// [`BackendError::NoDevice`] if none is meant, with the names of all.
pub fn choose_adapter(list: &[(&str, DeviceKind)], wanted: Option<&str>) -> Result<usize> {
    let Some(wanted) = wanted else {
        let gpu = list.iter().position(|&(_, kind)| kind == DeviceKind::Gpu);
        return Ok(gpu.unwrap_or(0));
    };
    let by_index = wanted.parse::<usize>().ok().filter(|&i| i < list.len());
    let lower = wanted.to_lowercase();
    let named = |(name, _): &(&str, DeviceKind)| name.to_lowercase().contains(&lower);
    by_index
        .or_else(|| list.iter().position(named))
        .ok_or_else(|| {
            let each = list.iter().enumerate();
            let names: Vec<_> = each.map(|(i, (name, _))| format!("{i} {name}")).collect();
            BackendError::NoDevice(format!("no adapter '{wanted}' among: {}", names.join(", ")))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_is_chosen_by_index_by_part_of_its_name_or_for_being_a_gpu() {
        let list = [
            ("llvmpipe", DeviceKind::Software),
            ("Fast Card", DeviceKind::Gpu),
        ];
        assert_eq!(choose_adapter(&list, None), Ok(1));
        assert_eq!(choose_adapter(&list[..1], None), Ok(0));
        assert_eq!(choose_adapter(&list, Some("0")), Ok(0));
        assert_eq!(choose_adapter(&list, Some("fast")), Ok(1));
        let refused = choose_adapter(&list, Some("9")).unwrap_err().to_string();
        assert!(refused.contains("0 llvmpipe, 1 Fast Card"), "{refused}");
    }
}
