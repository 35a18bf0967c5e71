//! Each stage as a list of dispatches. A dispatch reads what those before it wrote, so a barrier goes between any two.

mod rays;

pub use rays::{cleanse, count_any, count_blocked, count_hits, count_triangles, rays};

use crate::{Kernel, Params, Shape, common, kernel};
use backend::Method;
use geom::{Camera, Point};

/// A kernel to run. Its buffers are found by their names in [`Kernel::bindings`].
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Which.
    pub kernel: &'static Kernel,
    /// With what parameters.
    pub params: Params,
    /// Over what.
    pub groups: Groups,
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Groups {
    /// Enough for so many invocations, in as many rows as it takes.
    Linear(u32),
    /// One for each block of 16 x 8 pixels.
    Pixels(u32, u32),
}

/// A dispatch that no device of this kind takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyGroups {
    /// Workgroups along the longer axis.
    pub need: u32,
    /// How many may be.
    pub limit: u32,
}

/// Rays whose hits are sought.
#[derive(Clone, Copy, Debug)]
pub enum Rays<'a> {
    /// So many, given in the buffer `rays`.
    Given(u32),
    /// One a pixel, made by the kernel.
    Camera(&'a Camera),
}

impl Work {
    fn linear(kernel: &'static Kernel, params: Params, count: u32) -> Self {
        Self {
            kernel,
            params: Params { count, ..params },
            groups: Groups::Linear(count),
        }
    }

    fn over(method: Method, rays: Rays<'_>, params: Params, [given, camera]: [&str; 2]) -> Self {
        match rays {
            Rays::Given(count) => Self::linear(kernel(given, method), params, count),
            Rays::Camera(c) => Self {
                kernel: kernel(camera, method),
                params: params.through(c),
                groups: Groups::Pixels(c.width, c.height),
            },
        }
    }

    /// Workgroups along both axes, where one axis may have no more than `limit`.
    ///
    /// # Errors
    /// They are too many even in rows.
    pub fn group_counts(&self, limit: u32) -> Result<[u32; 2], TooManyGroups> {
        self.groups.counts(self.kernel.workgroup[0], limit)
    }
}

impl Groups {
    fn counts(self, workgroup: u32, limit: u32) -> Result<[u32; 2], TooManyGroups> {
        let [x, y] = match self {
            Self::Linear(count) => {
                let all = count.div_ceil(workgroup);
                let rows = all.div_ceil(limit).max(1);
                [all.div_ceil(rows), rows]
            }
            Self::Pixels(width, height) => [width.div_ceil(16), height.div_ceil(8)],
        };
        let need = x.max(y);
        match need > limit {
            true => Err(TooManyGroups { need, limit }),
            false => Ok([x, y]),
        }
    }
}

/// The test of a device's arithmetic, on so many [`crate::arithmetic::operands`].
#[must_use]
pub fn arithmetic(operands: usize) -> Work {
    Work::linear(common("arithmetic"), Params::default(), operands as u32)
}

/// Key frames to so many positions, the later weighing `alpha`.
#[must_use]
pub fn interpolate(params: Params, vertices: usize, alpha: f32) -> Work {
    let rows = (vertices * 3).div_ceil(4) as u32;
    Work::linear(common("interpolate"), Params { alpha, ..params }, rows)
}

/// A tree just adopted to its lists of nodes: once, before its first [`preprocess`].
#[must_use]
pub fn expand(params: Params) -> Work {
    Work {
        kernel: common("expand"),
        params,
        groups: Groups::Linear(params.node_count),
    }
}

/// Positions to records and boxes of leaves.
#[must_use]
pub fn preprocess(method: Method, params: Params, tree: &Shape) -> Work {
    Work::linear(kernel("preprocess", method), params, tree.leaf_count)
}

/// Boxes of leaves to boxes of inner nodes, level by level, and to the tree's cost.
#[must_use]
pub fn refit(params: Params, tree: &Shape) -> Vec<Work> {
    if tree.leaf_count == 0 {
        return Vec::new();
    }
    let refit = common("refit");
    let group = refit.workgroup[0];
    let mut work = Vec::with_capacity(tree.levels.len() + 1);
    let mut first_group = 0;
    for inner in tree.levels.iter().rev() {
        let count = inner.len() as u32;
        let params = Params {
            first: inner.start,
            first_group,
            ..params
        };
        work.push(Work::linear(refit, params, count));
        first_group += count.div_ceil(group);
    }
    let params = Params {
        count: first_group,
        ..params
    };
    work.push(Work {
        kernel: common("sum_costs"),
        params,
        groups: Groups::Linear(1),
    });
    work
}

/// Records and boxes to closest hits.
#[must_use]
pub fn closest(method: Method, params: Params, rays: Rays<'_>) -> Vec<Work> {
    vec![Work::over(
        method,
        rays,
        params,
        ["trace_rays", "trace_camera"],
    )]
}

/// Records and boxes to whether each of so many given rays meets anything.
#[must_use]
pub fn any(method: Method, params: Params, rays: u32) -> Vec<Work> {
    vec![Work::linear(kernel("any_rays", method), params, rays)]
}

/// Closest hits to whether the way from each to the light is blocked.
#[must_use]
pub fn shadow(method: Method, params: Params, rays: Rays<'_>, light: Point) -> Vec<Work> {
    let params = Params { light, ..params };
    vec![Work::over(
        method,
        rays,
        params,
        ["shadow_rays", "shadow_camera"],
    )]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_groups_than_one_axis_holds_go_into_rows() {
        assert_eq!(Groups::Linear(0).counts(128, 65535), Ok([0, 1]));
        assert_eq!(Groups::Linear(129).counts(128, 65535), Ok([2, 1]));
        let [x, y] = Groups::Linear(128 * 100_000).counts(128, 65535).unwrap();
        assert!(y == 2 && x * y >= 100_000 && x <= 65535);
        let (need, limit) = (70_000, 65535);
        let tall = Groups::Pixels(16, 8 * need).counts(128, limit);
        assert_eq!(tall, Err(TooManyGroups { need, limit }));
    }

    #[test]
    fn each_level_has_its_own_slots_of_costs_and_the_sum_takes_them_all() {
        let levels = vec![0..1, 1..3, 3..200, 200..500];
        let tree = Shape {
            leaf_count: 501,
            levels,
            ..Shape::default()
        };
        let work = refit(Params::default(), &tree);
        let slots = work.iter().map(|w| (w.params.first, w.params.first_group));
        let expected = [(200, 0), (3, 3), (1, 5), (0, 6), (0, 0)];
        assert_eq!(slots.collect::<Vec<_>>(), expected);
        let last = work.last().unwrap();
        assert_eq!((last.kernel.name, last.params.count), ("sum_costs", 7));
        assert!(Shape::cost_bytes(501) >= 7 * 4);
    }

    #[test]
    fn a_lone_leaf_has_a_cost_and_no_leaf_has_no_work() {
        let lone = Shape {
            leaf_count: 1,
            node_count: 1,
            ..Shape::default()
        };
        let work = refit(Params::default(), &lone);
        assert_eq!((work.len(), work[0].params.count), (1, 0));
        assert!(refit(Params::default(), &Shape::default()).is_empty());
    }
}
