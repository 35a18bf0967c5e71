//! Rasterization: first hits of a camera's rays found triangle by triangle; who can, and when it pays.

use crate::packets::{PIXELS_A_TRIANGLE, SMALL_PICTURE};
use crate::{Counts, Packets, Params};
use backend::{Intersector, Layout, Method};

/// How the 32 invocations that share tests tell each other of them, as for packets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rasterization {
    /// As a subgroup.
    BySubgroups,
    /// Through the memory of a workgroup: software drivers, for small pictures alone, on which laws are tried.
    ByGroups,
}

/// How far it was measured: see "Rasterization" in ARCHITECTURE.md. Five kernels one after the other take their time of small pictures,
/// where trees are small too; of many triangles most cover no pixel, but each is looked at.
const LEAST_PIXELS: u64 = 1 << 20;
const MANY_TRIANGLES: u32 = 450_000;
const LEAST_PIXELS_OF_MANY: u64 = 1 << 18;
const MOST_TRIANGLES: u32 = 1 << 23;
const MOST_PIXELS: u64 = 1 << 24;
/// What is hardly a picture is not worth the time that drivers take to make five kernels.
const LEAST_PIXELS_AT_ALL: u64 = 1 << 8;

/// Traces that go without rasterization after one that those told too little of: to find that out takes about a tenth of a trace.
const REST: u32 = 64;

/// Whether to try rasterization: not for a while where they told too little, as they will where many triangles lie behind each other.
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

    /// What the next trace may take of what the device does.
    pub fn allow(&mut self, rasterization: Option<Rasterization>) -> Option<Rasterization> {
        let rests = self.rest > 0;
        self.rest = self.rest.saturating_sub(1);
        rasterization.filter(|_| !rests)
    }
}

impl Rasterization {
    /// What a device takes that knows the least of numbers of 64 bits and goes by these packets.
    #[must_use]
    pub fn for_device(packets: Option<Packets>) -> Option<Self> {
        packets.map(|packets| match packets {
            Packets::BySubgroups => Self::BySubgroups,
            Packets::ByGroups => Self::ByGroups,
        })
    }

    /// The kernel that tests what tiles may cover.
    pub(crate) fn kernel(self) -> &'static str {
        match self {
            Self::BySubgroups => "rasterize_by_subgroups",
            Self::ByGroups => "rasterize",
        }
    }

    /// Workgroups that share all tiles: 32 a multiprocessor of an H200, of which some wait while others compute.
    pub(crate) fn sharers(self) -> u32 {
        match self {
            Self::BySubgroups => 4224,
            Self::ByGroups => 64,
        }
    }
}

/// Whether a camera's rays, with parameters made for it, that do not go by packets go by rasterization.
pub(crate) fn pay(method: Method, params: &Params, how: Rasterization) -> bool {
    let triangles = params.node_count.div_ceil(2);
    let pixels = u64::from(params.width) * u64::from(params.height);
    let are_dense = pixels < PIXELS_A_TRIANGLE * u64::from(triangles);
    let is_fast = how == Rasterization::BySubgroups
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
        let (large, larger) = ([1920, 1200], [3840, 2160]);
        for (triangles, size, how, pays) in [
            (1_600_000, large, Rasterization::BySubgroups, true),
            (1_600_000, large, Rasterization::ByGroups, false),
            (MOST_TRIANGLES + 1, large, Rasterization::BySubgroups, false),
            (1_600_000, [800, 600], Rasterization::BySubgroups, true),
            (1_600_000, [512, 511], Rasterization::BySubgroups, false),
            (1_600_000, larger, Rasterization::BySubgroups, true),
            (1_600_000, [4097, 4096], Rasterization::BySubgroups, false),
            (MANY_TRIANGLES, larger, Rasterization::BySubgroups, true),
            (
                MANY_TRIANGLES - 1,
                larger,
                Rasterization::BySubgroups,
                false,
            ),
            (
                MANY_TRIANGLES - 1,
                [1280, 820],
                Rasterization::BySubgroups,
                true,
            ),
            (
                MANY_TRIANGLES - 1,
                [1280, 800],
                Rasterization::BySubgroups,
                false,
            ),
            (10_000, [128, 128], Rasterization::BySubgroups, true),
            (10_000, [128, 128], Rasterization::ByGroups, true),
            (4096, [128, 128], Rasterization::ByGroups, false),
            (100, [16, 16], Rasterization::ByGroups, true),
            (100, [16, 15], Rasterization::ByGroups, false),
        ] {
            let about = format!("{triangles} triangles, {size:?}, {how:?}");
            assert_eq!(pay(METHOD, &params(triangles, size), how), pays, "{about}");
        }
    }

    #[test]
    fn rasters_rest_after_they_told_too_little_and_are_tried_again() {
        let mut raster_backoff = RasterBackoff::default();
        let counts = |untold| Counts {
            untold,
            ..Counts::default()
        };
        let tried = |raster_backoff: &mut RasterBackoff| {
            raster_backoff
                .allow(Some(Rasterization::BySubgroups))
                .is_some()
        };
        raster_backoff.note(&counts(0));
        assert!(tried(&mut raster_backoff) && tried(&mut raster_backoff));
        raster_backoff.note(&counts(1));
        // What else was under way says the same a little later, or nothing.
        assert!(!tried(&mut raster_backoff));
        raster_backoff.note(&counts(1));
        raster_backoff.note(&counts(0));
        let rested = (0..1000).position(|_| tried(&mut raster_backoff));
        assert_eq!(rested, Some(REST as usize));
        assert!(raster_backoff.allow(None).is_none());
    }

    #[test]
    fn other_methods_go_without() {
        let usual = params(1_600_000, [1920, 1200]);
        for method in [
            Method {
                intersector: Intersector::Exact,
                ..METHOD
            },
            Method {
                layout: Layout::Bvh2,
                ..METHOD
            },
        ] {
            assert!(!pay(method, &usual, Rasterization::BySubgroups));
        }
    }
}
