//! Each stage as a list of dispatches. A dispatch reads what those before it wrote, so a barrier goes between any two.

mod extremes;
mod pictures;
mod rays;
mod tree;
mod treelets;

pub use extremes::{kernels_of_arriving_keys, measure_range};
pub use pictures::shade;
pub use rays::{cleanse, count_answers, count_triangles, rays};
pub use tree::{Progress, leaves};
pub(crate) use tree::{sum, word_of};

use crate::{Kernel, Params, Traits, common, kernel, notes, open_shadows_at, places};
use backend::{Intersector, Method, QueryKind};
use extremes::Extremes;
use geom::Camera;

/// A kernel to run. Its buffers are found by their names in [`Kernel::bindings`].
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Which.
    pub kernel: &'static Kernel,
    /// With what parameters.
    pub params: Params,
    /// Over what.
    pub groups: Groups,
    /// Whether it reads nothing that the one before it writes, so that both may run at once. Of a stage's first:
    /// whether it may run beside `interpolate`, where that comes just before.
    pub alongside: bool,
    /// Of a trace: its place among those of the submission, which may run at once.
    pub place: usize,
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Groups {
    /// Enough for so many invocations, in as many rows as it takes.
    Linear(u32),
    /// So many, in as many rows as it takes.
    Each(u32),
    /// One for each block of so many pixels of a picture, along both axes.
    Pixels([u32; 2], [u32; 2]),
}

/// Rays whose hits are sought.
#[derive(Clone, Copy, Debug)]
pub enum Rays<'a> {
    /// So many, given in the buffer `rays`; and whether any of them may be extreme.
    Given(u32, bool),
    /// One a pixel, made by the kernel.
    Camera(&'a Camera),
}

/// Invocations that share the list of rays to settle, 16 a ray: enough to fill any device, though most find nothing to do.
const SETTLERS: u32 = 1 << 15;
/// Workgroups that share the list of hits whose shadows are sought, one a ray.
const SEARCHERS: u32 = 1 << 10;
/// Candidates of a ray that such workgroups take at once: see `intersect/resolve_together.wgsl`.
pub(crate) const ABREAST: u32 = 4;

impl Rays<'_> {
    fn count(self) -> u32 {
        match self {
            Self::Given(count, _) => count,
            Self::Camera(camera) => camera.width * camera.height,
        }
    }
}

impl Work {
    pub(crate) fn new(kernel: &'static Kernel, params: Params, groups: Groups) -> Self {
        Self {
            kernel,
            params,
            groups,
            alongside: false,
            place: 0,
        }
    }

    pub(crate) fn linear(kernel: &'static Kernel, params: Params, count: u32) -> Self {
        Self::new(kernel, Params { count, ..params }, Groups::Linear(count))
    }

    fn over(method: Method, rays: Rays<'_>, params: Params, [given, camera]: [&str; 2]) -> Self {
        match rays {
            Rays::Given(count, _) => Self::linear(kernel(given, method), params, count),
            Rays::Camera(c) => {
                let groups = Groups::Pixels([c.width, c.height], [16, 8]);
                Self::new(kernel(camera, method), params.through(c), groups)
            }
        }
    }

    /// Workgroups along both axes, where one axis may have no more than `limit`.
    ///
    /// # Errors
    /// They are too many even in rows: so many along the longer axis.
    pub fn group_counts(&self, limit: u32) -> Result<[u32; 2], u32> {
        self.groups.counts(self.kernel.workgroup[0], limit)
    }
}

impl Groups {
    fn counts(self, workgroup: u32, limit: u32) -> Result<[u32; 2], u32> {
        let [x, y] = match self {
            Self::Linear(count) => in_rows(count.div_ceil(workgroup), limit),
            Self::Each(count) => in_rows(count, limit),
            Self::Pixels([width, height], [x, y]) => [width.div_ceil(x), height.div_ceil(y)],
        };
        let need = x.max(y);
        match need > limit {
            true => Err(need),
            false => Ok([x, y]),
        }
    }
}

fn in_rows(all: u32, limit: u32) -> [u32; 2] {
    let rows = all.div_ceil(limit).max(1);
    [all.div_ceil(rows), rows]
}

/// The test of a device's arithmetic, on so many [`crate::arithmetic::operands`].
pub fn arithmetic(operands: usize) -> Work {
    Work::linear(common("arithmetic"), Params::default(), operands as u32)
}

/// Key frames to positions of so many vertices, the later weighing [`Params::alpha`]; or to so many rows of four floats alone,
/// given in the buffer `moving_rows`: see [`crate::moving_rows`].
pub fn interpolate(mut params: Params, vertices: usize, moving_rows: Option<usize>) -> Work {
    params.listed = moving_rows.is_some().into();
    let rows = moving_rows.unwrap_or((vertices * 3).div_ceil(4));
    Work::linear(common("interpolate"), params, rows as u32)
}

/// So many words of positions to a key frame, from a word of one buffer on to a word of the other.
pub fn copy_points(count: usize, [from, to]: [usize; 2]) -> Work {
    let params = Params {
        first: from as u32,
        destination: to as u32,
        ..Params::default()
    };
    Work::linear(common("copy_points"), params, count as u32)
}

/// What a trace dispatches.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Records and boxes to hits, or to whether there are any.
    pub primary: Vec<Work>,
    /// Hits to shadows, where `primary` does not find them too.
    pub shadow: Option<Vec<Work>>,
    /// Bytes that the buffer `covers` must have.
    pub cover_bytes: u64,
    /// Likewise the buffer `visibility`.
    pub visibility_bytes: u64,
}

/// Records and boxes to what is sought, on a device with these traits.
pub fn trace(
    method: Method,
    params: Params,
    rays: Rays<'_>,
    kind: QueryKind,
    traits: Traits,
) -> Trace {
    let how = Extremes::among(method, &params, rays);
    let mut trace = match how {
        Extremes::All => Trace::default(),
        _ => usual(method, params.known(), rays, kind, traits),
    };
    if how != Extremes::None {
        let last = trace.shadow.as_mut().unwrap_or(&mut trace.primary);
        last.extend(extremes::work(method, params, (rays, how), kind));
    }
    trace
}

fn usual(method: Method, params: Params, rays: Rays<'_>, kind: QueryKind, traits: Traits) -> Trace {
    let primary = |primary| Trace {
        primary,
        ..Trace::default()
    };
    match kind {
        QueryKind::Any => {
            let rays = Rays::Given(rays.count(), false);
            primary(search(method, params, rays, ["any_rays"; 2], ANY))
        }
        QueryKind::Closest => primary(closest(method, params, rays)),
        QueryKind::ClosestAndShadow { light } => {
            let params = params.lit(light);
            match rays {
                Rays::Given(..) => Trace {
                    primary: closest(method, params, rays),
                    shadow: Some(search(method, params, rays, ["shadow_rays"; 2], SHADOWS)),
                    ..Trace::default()
                },
                Rays::Camera(camera) => picture(method, params, camera, traits),
            }
        }
    }
}

fn closest(method: Method, params: Params, rays: Rays<'_>) -> Vec<Work> {
    let kernels = ["trace_rays", "trace_camera"];
    search(method, params, rays, kernels, HITS)
}

/// A camera's closest hits and their shadows: by packets, by rasterization, or ray by ray.
fn picture(method: Method, params: Params, camera: &Camera, traits: Traits) -> Trace {
    let rays = Rays::Camera(camera);
    let mut params = searching(params, rays);
    // Both lists of open rays are in use at once.
    params.destination = open_shadows_at(params.first.into()) as u32;
    let mut trace = pictures::by_packets(method, params, camera, traits)
        .or_else(|| pictures::by_rasterization(method, params, camera, traits))
        .unwrap_or_else(|| Trace {
            primary: vec![Work::over(
                method,
                rays,
                params,
                ["trace_and_shadow_camera"; 2],
            )],
            ..Trace::default()
        });
    if method.intersector == Intersector::Exact {
        trace.primary.extend(resolve_together(method, params, rays));
    }
    trace
}

/// Resolves the hits and shadows that `exact` left open in a picture. Both are resolved at once, beside which the shadows of all
/// candidates are sought; then those of hits that were not resolved so.
fn resolve_together(method: Method, params: Params, rays: Rays<'_>) -> [Work; 4] {
    let sharers = settlers(&params).div_ceil(64);
    let searchers = SEARCHERS.min(params.first);
    let open = |kernel, params, groups| over_open(method, rays, kernel, params, groups);
    let finish = |kernel| open(kernel, params, finishers(&params));
    let shared = Params {
        first_group: sharers,
        ..params
    };
    let settle = Groups::Each(2 * sharers + ABREAST * searchers);
    [
        open("resolve_exact_together", shared, settle),
        finish(HITS[1]),
        open("shadow_left", params, Groups::Each(searchers)),
        finish(SHADOWS[1]),
    ]
}

const HITS: [&str; 2] = ["resolve_exact_rays", "fallback_rays"];
const ANY: [&str; 2] = ["resolve_exact_any_rays", "fallback_any_rays"];
const SHADOWS: [&str; 2] = ["resolve_exact_shadow_rays", "fallback_shadow_rays"];

/// What a search over all rays is told, and those who settle what it leaves open.
fn searching(mut params: Params, rays: Rays<'_>) -> Params {
    let count = rays.count();
    (params.first, params.destination) = (count, count);
    params.places = places(count.into());
    params.notes = notes(count.into()) as u32;
    params
}

fn settlers(params: &Params) -> u32 {
    SETTLERS.min(params.first.saturating_mul(16))
}

/// Of those who settle one by one.
fn finishers(params: &Params) -> Groups {
    Groups::Linear(16 * params.places)
}

/// What goes over rays that a search left open.
fn over_open(method: Method, rays: Rays<'_>, kernel: &str, params: Params, groups: Groups) -> Work {
    Work {
        groups,
        ..Work::over(method, rays, params, [kernel; 2])
    }
}

/// A search by kernels for given rays or a camera's. For `exact`, notes then settle most of the rays that it left open; the
/// rest are settled one by one.
fn search(
    method: Method,
    params: Params,
    rays: Rays<'_>,
    kernels: [&str; 2],
    [settle, finish]: [&str; 2],
) -> Vec<Work> {
    let over_all = Work::over(method, rays, searching(params, rays), kernels);
    let params = over_all.params;
    let open = |kernel, groups| over_open(method, rays, kernel, params, groups);
    let mut all = vec![over_all];
    if method.intersector == Intersector::Exact {
        let settlers = Groups::Linear(settlers(&params));
        all.extend([open(settle, settlers), open(finish, finishers(&params))]);
    }
    all
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
        let tall = Groups::Pixels([16, 8 * need], [16, 8]).counts(128, limit);
        assert_eq!(tall, Err(need));
    }
}
