//! How cores are shared between rendering and building.

use crate::Update;
use backend::DeviceKind;

/// Threads of the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads {
    /// For the backend and for shading.
    pub render: usize,
    /// For trees.
    pub build: usize,
}

impl Threads {
    /// Shares `cores` out, where threads that render or build are not given. With `async` both work at once: where the host
    /// renders, a quarter builds on four cores or more; where a GPU does, all but the one that feeds it. With the other
    /// policies one waits for the other, so both have all.
    #[must_use]
    pub fn share(
        cores: usize,
        kind: DeviceKind,
        update: Update,
        [render, build]: [Option<usize>; 2],
    ) -> Self {
        let quarter = |n: usize| (n / 4).max(1);
        let concurrent = matches!(update, Update::Async(_));
        let n = render.unwrap_or(cores);
        let (render, default) = match (concurrent, kind, render) {
            (false, ..) => (n, n),
            (true, DeviceKind::Gpu, _) => (n, (n - 1).max(1)),
            (true, _, None) if cores >= 4 => (cores - quarter(cores), quarter(cores)),
            (true, _, None) => (n, 1),
            (true, _, Some(n)) => (n, quarter(n)),
        };
        Self {
            render,
            build: build.unwrap_or(default),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pace;

    #[test]
    fn cores_are_shared_where_builder_and_renderer_work_at_once() {
        use DeviceKind::{Cpu, Gpu, Software};
        let (free, refit) = (Update::Async(Pace::Free), Update::Refit);
        // Cores, what was asked for, and threads that render and that build.
        for (kind, update, cores, asked, expected) in [
            (Cpu, free, 16, [None, None], [12, 4]),
            (Software, free, 16, [None, None], [12, 4]),
            (Cpu, free, 4, [None, None], [3, 1]),
            (Cpu, free, 2, [None, None], [2, 1]),
            (Cpu, free, 16, [Some(1), None], [1, 1]),
            (Software, free, 16, [Some(8), None], [8, 2]),
            (Gpu, free, 16, [None, None], [16, 15]),
            (Gpu, free, 1, [None, None], [1, 1]),
            (Gpu, free, 16, [Some(1), None], [1, 1]),
            (Gpu, free, 16, [None, Some(3)], [16, 3]),
            // Who waits lends all.
            (Cpu, refit, 8, [None, None], [8, 8]),
            (Gpu, refit, 8, [Some(2), Some(5)], [2, 5]),
        ] {
            let t = Threads::share(cores, kind, update, asked);
            assert_eq!([t.render, t.build], expected, "{kind:?} {cores} {asked:?}");
        }
    }
}
