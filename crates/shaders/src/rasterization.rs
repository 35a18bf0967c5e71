//! Rasterization: first hits of a camera's rays found triangle by triangle; who can, and when it pays.

use crate::packets::{PIXELS_A_TRIANGLE, SMALL_PICTURE};
use crate::{Counts, Packets, Params};
use backend::{Intersector, Layout, Method};

/// How far it was measured: see `docs/design/visibility-buffer.md`. Five kernels in a row take their time of small pictures, where
/// trees are small too; of many triangles most cover no pixel, but each is looked at.
const LEAST_PIXELS: u64 = 1 << 20;
const MANY_TRIANGLES: u32 = 450_000;
const LEAST_PIXELS_OF_MANY: u64 = 1 << 18;
const MOST_TRIANGLES: u32 = 1 << 23;
const MOST_PIXELS: u64 = 1 << 24;
/// What is hardly a picture is not worth the time that drivers take to make five kernels.
const LEAST_PIXELS_AT_ALL: u64 = 1 << 8;

/// Traces that go without rasterization after one of which it told too little: to find that out takes a tenth of a trace.
const REST: u32 = 64;

/// Whether to try rasterization: not for a while where it told too little, as where many triangles lie behind each other.
#[derive(Clone, Copy, Debug, Default)]
pub struct RasterBackoff {
    rest: u32,
}

impl RasterBackoff {
    /// Takes in what a submission counted.
    pub fn note(&mut self, counts: &Counts) {
        if counts.untold != 0 {
            self.rest = REST;
        }
    }

    /// Whether the next trace may be rasterized, where the device `rasterizes`.
    pub fn allow(&mut self, rasterizes: bool) -> bool {
        let rests = self.rest > 0;
        self.rest = self.rest.saturating_sub(1);
        rasterizes && !rests
    }
}

/// The kernel that tests what tiles may cover.
pub(crate) fn kernel(how: Packets) -> &'static str {
    match how {
        Packets::BySubgroups => "rasterize_by_subgroups",
        Packets::ByGroups => "rasterize",
    }
}

/// Workgroups that share all tiles: 32 a multiprocessor of an H200, of which some wait while others compute.
pub(crate) fn sharers(how: Packets) -> u32 {
    match how {
        Packets::BySubgroups => 4224,
        Packets::ByGroups => 64,
    }
}

/// Whether a camera's rays, with parameters made for it, that do not go by packets go by rasterization.
pub(crate) fn pay(method: Method, params: &Params, how: Packets) -> bool {
    let triangles = params.node_count.div_ceil(2);
    let pixels = u64::from(params.width) * u64::from(params.height);
    let are_dense = pixels < PIXELS_A_TRIANGLE * u64::from(triangles);
    let is_fast = how == Packets::BySubgroups
        && triangles <= MOST_TRIANGLES
        && pixels <= MOST_PIXELS
        && ((are_dense && pixels >= LEAST_PIXELS)
            || (triangles >= MANY_TRIANGLES && pixels >= LEAST_PIXELS_OF_MANY));
    // So that laws are tried.
    let is_small = are_dense && (LEAST_PIXELS_AT_ALL..=SMALL_PICTURE).contains(&pixels);
    method.intersector == Intersector::Watertight
        && method.layout == Layout::Fast
        && (is_fast || is_small)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shape;

    const METHOD: Method = Method {
        intersector: Intersector::Watertight,
        layout: Layout::Fast,
    };

    fn params(triangles: u32, [width, height]: [u32; 2]) -> Params {
        let shape = Shape {
            node_count: 2 * triangles - 1,
            ..Shape::default()
        };
        Params {
            width,
            height,
            ..Params::of(0, &shape)
        }
    }

    #[test]
    fn rasters_pay_as_far_as_that_was_measured() {
        let (large, larger, fewer) = ([1920, 1200], [3840, 2160], MANY_TRIANGLES - 1);
        for (triangles, size, by_subgroups, by_groups) in [
            (1_600_000, large, true, false),
            (MOST_TRIANGLES + 1, large, false, false),
            (1_600_000, [800, 600], true, false),
            (1_600_000, [512, 511], false, false),
            (1_600_000, larger, true, false),
            (1_600_000, [4097, 4096], false, false),
            (MANY_TRIANGLES, larger, true, false),
            (fewer, larger, false, false),
            (fewer, [1280, 820], true, false),
            (fewer, [1280, 800], false, false),
            (10_000, [128, 128], true, true),
            (4096, [128, 128], false, false),
            (100, [16, 16], true, true),
            (100, [16, 15], false, false),
        ] {
            let all = [
                (Packets::BySubgroups, by_subgroups),
                (Packets::ByGroups, by_groups),
            ];
            for (how, pays) in all {
                let about = format!("{triangles} triangles, {size:?}, {how:?}");
                assert_eq!(pay(METHOD, &params(triangles, size), how), pays, "{about}");
            }
        }
        let usual = params(1_600_000, large);
        let (exact, bvh2) = (Intersector::Exact, Layout::Bvh2);
        for (intersector, layout) in [(exact, METHOD.layout), (METHOD.intersector, bvh2)] {
            let other = Method {
                intersector,
                layout,
            };
            assert!(!pay(other, &usual, Packets::BySubgroups));
        }
    }
}
