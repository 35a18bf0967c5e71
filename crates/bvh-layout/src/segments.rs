//! An array by levels, cut into the parts that chunks may write at once.

/// Cuts `array` into one part for each level and chunk, levels outermost, as
/// long as `lengths` says. Returns each chunk's parts by level.
///
/// # Panics
/// If `array` is shorter than all parts together.
pub(crate) fn segments<'a, T, C, const LEVELS: usize>(
    mut array: &'a mut [T],
    chunks: &[C],
    lengths: impl Fn(&C) -> &[u32; LEVELS],
) -> Vec<[&'a mut [T]; LEVELS]> {
    let empty = || std::array::from_fn(|_| <&mut [T]>::default());
    let mut parts: Vec<_> = chunks.iter().map(|_| empty()).collect();
    for level in 0..LEVELS {
        for (chunk, parts) in chunks.iter().zip(&mut parts) {
            let length = lengths(chunk)[level] as usize;
            let (part, rest) = array.split_at_mut(length);
            (parts[level], array) = (part, rest);
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::segments;

    #[test]
    fn levels_are_outermost() {
        let mut array = [0, 1, 2, 3, 4, 5];
        let parts = segments(&mut array, &[[1, 2], [0, 3]], |lengths| lengths);
        assert_eq!(parts[0], [&mut [0][..], &mut [1, 2]]);
        assert_eq!(parts[1], [&mut [][..], &mut [3, 4, 5]]);
    }
}
