//! How cores are shared between rendering and building.

use pipeline::Update;
use std::num::NonZero;

/// Threads that render, and threads that build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Threads {
    /// For the backend and for shading.
    pub(crate) render: usize,
    /// For trees.
    pub(crate) build: usize,
}

/// Logical cores this process may use.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Keeps work outside the backend (reading, shading) to `threads`, if that many were asked for.
pub(crate) fn limit(threads: Option<usize>) {
    if let Some(n) = threads {
        // It fails only if the pool runs already; then it stays as it is.
        let _ = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build_global();
    }
}

/// Shares `cores` out. With `async` both work at once, so on four cores or more
/// a quarter builds; with the other policies one waits for the other, so both have all.
pub(crate) fn share(
    cores: usize,
    update: Update,
    render: Option<usize>,
    build: Option<usize>,
) -> Threads {
    let quarter = |n: usize| (n / 4).max(1);
    let concurrent = matches!(update, Update::Async(_));
    let default = match (concurrent, render) {
        (true, None) if cores >= 4 => Threads {
            render: cores - quarter(cores),
            build: quarter(cores),
        },
        (true, n) => Threads {
            render: n.unwrap_or(cores),
            build: quarter(n.unwrap_or(1)),
        },
        (false, n) => Threads {
            render: n.unwrap_or(cores),
            build: n.unwrap_or(cores),
        },
    };
    Threads {
        build: build.unwrap_or(default.build),
        ..default
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pipeline::Pace;

    #[test]
    fn async_leaves_a_quarter_to_the_builder_where_there_are_four() {
        let shared = |cores, render| {
            let t = share(cores, Update::Async(Pace::Free), render, None);
            (t.render, t.build)
        };
        assert_eq!(shared(16, None), (12, 4));
        assert_eq!(shared(4, None), (3, 1));
        assert_eq!(shared(2, None), (2, 1));
        assert_eq!(shared(16, Some(1)), (1, 1));
        assert_eq!(shared(16, Some(8)), (8, 2));
    }

    #[test]
    fn who_waits_lends_all_and_what_is_asked_for_is_given() {
        let t = share(8, Update::Rebuild, None, None);
        assert_eq!((t.render, t.build), (8, 8));
        let t = share(8, Update::Refit, Some(2), Some(5));
        assert_eq!((t.render, t.build), (2, 5));
    }
}
