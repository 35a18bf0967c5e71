//! How cores are shared between rendering and building.

use backend::DeviceKind;
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

/// Shares `cores` out. With `async` both work at once: where the host renders, a quarter builds
/// on four cores or more; where a GPU does, all but the one that feeds it. With
/// the other policies one waits for the other, so both have all.
pub(crate) fn share(
    cores: usize,
    kind: DeviceKind,
    update: Update,
    render: Option<usize>,
    build: Option<usize>,
) -> Threads {
    let quarter = |n: usize| (n / 4).max(1);
    let concurrent = matches!(update, Update::Async(_));
    let default = match (concurrent, kind, render) {
        (true, DeviceKind::Gpu, n) => Threads {
            render: n.unwrap_or(cores),
            build: (n.unwrap_or(cores) - 1).max(1),
        },
        (true, _, None) if cores >= 4 => Threads {
            render: cores - quarter(cores),
            build: quarter(cores),
        },
        (true, _, n) => Threads {
            render: n.unwrap_or(cores),
            build: quarter(n.unwrap_or(1)),
        },
        (false, _, n) => Threads {
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

    const FREE: Update = Update::Async(Pace::Free);

    fn shared(kind: DeviceKind, cores: usize, render: Option<usize>) -> (usize, usize) {
        let t = share(cores, kind, FREE, render, None);
        (t.render, t.build)
    }

    #[test]
    fn async_leaves_a_quarter_to_the_builder_where_there_are_four() {
        for kind in [DeviceKind::Cpu, DeviceKind::Software] {
            let shared = |cores, render| shared(kind, cores, render);
            assert_eq!(shared(16, None), (12, 4));
            assert_eq!(shared(4, None), (3, 1));
            assert_eq!(shared(2, None), (2, 1));
            assert_eq!(shared(16, Some(1)), (1, 1));
            assert_eq!(shared(16, Some(8)), (8, 2));
        }
    }

    #[test]
    fn beside_a_gpu_all_cores_but_one_build() {
        let shared = |cores, render| shared(DeviceKind::Gpu, cores, render);
        assert_eq!(shared(16, None), (16, 15));
        assert_eq!(shared(1, None), (1, 1));
        assert_eq!(shared(16, Some(1)), (1, 1));
        assert_eq!(share(16, DeviceKind::Gpu, FREE, None, Some(3)).build, 3);
    }

    #[test]
    fn who_waits_lends_all_and_what_is_asked_for_is_given() {
        for kind in [DeviceKind::Cpu, DeviceKind::Gpu] {
            let t = share(8, kind, Update::Rebuild, None, None);
            assert_eq!((t.render, t.build), (8, 8));
            let t = share(8, kind, Update::Refit, Some(2), Some(5));
            assert_eq!((t.render, t.build), (2, 5));
        }
    }
}
