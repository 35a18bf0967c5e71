//! Selects packets or rasterization for pictures, where the device supports them and they are faster than single rays.
//! Also selects them for some small pictures, for tests.

use crate::{Counts, Params};

/// How the 32 invocations of a packet communicate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packets {
    /// As a subgroup.
    BySubgroups,
    /// Through workgroup memory, for software drivers, whose subgroups are narrower or missing.
    ByGroups,
}

/// Minimum number of pixels per triangle for packets, which first project all triangles.
const PIXELS_A_TRIANGLE: u64 = 4;
/// Maximum number of pixels for packets on a software driver. Single rays are faster there, but property tests have to
/// cover packets too.
const SMALL_PICTURE: u64 = 1 << 14;

impl Packets {
    /// Returns the kind of packets for a device, given the least and greatest size of its subgroups.
    pub fn for_device(subgroups: Option<(u32, u32)>, is_software: bool) -> Option<Self> {
        match subgroups {
            _ if is_software => Some(Self::ByGroups),
            Some((32, 32)) => Some(Self::BySubgroups),
            _ => None,
        }
    }

    /// Returns the kernel that traces a picture, and the block of pixels that a workgroup covers.
    pub(crate) fn tracer(self) -> (&'static str, [u32; 2]) {
        match self {
            Self::BySubgroups => ("trace_packets_by_subgroups", [16, 8]),
            Self::ByGroups => ("trace_packets", [8, 4]),
        }
    }

    /// Returns the kernel that tests the pixels of tiles, and the maximum number of its workgroups. For subgroups: 32
    /// per multiprocessor of an H200, so that some compute while others wait.
    pub(crate) fn rasterizers(self) -> (&'static str, u32) {
        match self {
            Self::BySubgroups => ("rasterize_by_subgroups", 4224),
            Self::ByGroups => ("rasterize", 64),
        }
    }
}

/// This and the next constants are measured limits of rasterization: see `docs/design/visibility-buffer.md`. Its five
/// kernels take a minimum time, so small pictures of small trees do not benefit. Large scenes do not benefit either,
/// because all triangles are projected although most cover no pixel. `LEAST_PIXELS` is for pictures with few pixels per
/// triangle, `LEAST_PIXELS_OF_MANY` for at least `MANY_TRIANGLES` triangles.
const LEAST_PIXELS: u64 = 1 << 20;
const MANY_TRIANGLES: u32 = 450_000;
const LEAST_PIXELS_OF_MANY: u64 = 1 << 18;
const MOST_TRIANGLES: u32 = 1 << 23;
const MOST_PIXELS: u64 = 1 << 24;
/// Minimum number of pixels that justifies the time for compiling five kernels.
const LEAST_PIXELS_AT_ALL: u64 = 1 << 8;

/// Returns the number of triangles and of pixels, from parameters with a camera.
fn sizes(params: &Params) -> (u32, u64) {
    let pixels = u64::from(params.width) * u64::from(params.height);
    (params.node_count.div_ceil(2), pixels)
}

/// Returns whether packets and rasterization suit the scene. Their error bounds are proportional to the size of the
/// whole scene, so the scene must not be far larger than most triangles.
fn is_suited(params: &Params) -> bool {
    params.spread == 0
}

/// Returns whether packets are faster than single rays. Also accepts small pictures on software drivers, for tests.
/// `params` must contain a camera.
pub(crate) fn are_packets_faster(params: &Params, how: Packets) -> bool {
    let (triangles, pixels) = sizes(params);
    is_suited(params)
        && params.wide_root != 0
        && pixels >= PIXELS_A_TRIANGLE * u64::from(triangles)
        && (how == Packets::BySubgroups || pixels <= SMALL_PICTURE)
}

/// Returns whether rasterization is faster than single rays. Also accepts some small pictures, for tests. Packets
/// take precedence. `params` must contain a camera.
pub(crate) fn is_rasterization_faster(params: &Params, how: Packets) -> bool {
    let (triangles, pixels) = sizes(params);
    let are_dense = pixels < PIXELS_A_TRIANGLE * u64::from(triangles);
    let is_fast = how == Packets::BySubgroups
        && triangles <= MOST_TRIANGLES
        && pixels <= MOST_PIXELS
        && ((are_dense && pixels >= LEAST_PIXELS)
            || (triangles >= MANY_TRIANGLES && pixels >= LEAST_PIXELS_OF_MANY));
    // Lets property tests run on every device.
    let is_small = are_dense && (LEAST_PIXELS_AT_ALL..=SMALL_PICTURE).contains(&pixels);
    is_suited(params) && (is_fast || is_small)
}

/// Number of traces without rasterization after an incomplete rasterization. An incomplete one costs about a tenth of
/// a trace.
const BACKOFF_TRACES: u32 = 64;

/// Suspends rasterization for a while if it was incomplete, for example because of many layers of triangles.
#[derive(Clone, Copy, Debug, Default)]
pub struct RasterBackoff {
    /// Number of traces until rasterization is allowed again.
    traces_left: u32,
}

impl RasterBackoff {
    /// Updates the state from the counts of a submission.
    pub fn update(&mut self, counts: &Counts) {
        if counts.raster_incomplete != 0 {
            self.traces_left = BACKOFF_TRACES;
        }
    }

    /// Returns whether the next trace may be rasterized, given whether the device `rasterizes`.
    pub fn allow(&mut self, rasterizes: bool) -> bool {
        let is_suspended = self.traces_left > 0;
        self.traces_left = self.traces_left.saturating_sub(1);
        rasterizes && !is_suspended
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shape;

    #[test]
    fn packet_mode_depends_on_subgroups() {
        let of = Packets::for_device;
        assert_eq!(of(Some((32, 32)), false), Some(Packets::BySubgroups));
        for other in [Some((8, 32)), Some((64, 64)), None] {
            assert_eq!(of(other, false), None);
        }
        assert_eq!(of(Some((8, 8)), true), Some(Packets::ByGroups));
    }

    /// Returns parameters for a picture of this size and for a wide tree of `triangles` triangles.
    fn params(triangles: u32, [width, height]: [u32; 2]) -> Params {
        Params {
            width,
            height,
            ..Shape::expected(triangles).params
        }
    }

    #[test]
    fn packets_require_enough_pixels() {
        let most = 64 * 48 / 4;
        let [usual, more] = [most, most + 1].map(|triangles| params(triangles, [64, 48]));
        for how in [Packets::BySubgroups, Packets::ByGroups] {
            assert!(are_packets_faster(&usual, how));
            assert!(!are_packets_faster(&more, how));
        }
        let spread = Params { spread: 1, ..usual };
        assert!(!are_packets_faster(&spread, Packets::BySubgroups));
        let no_wide_tree = Params {
            wide_root: 0,
            ..usual
        };
        assert!(!are_packets_faster(&no_wide_tree, Packets::BySubgroups));
        let too_many_triangles = params(1_600_000, [3840, 2160]);
        assert!(!are_packets_faster(
            &too_many_triangles,
            Packets::BySubgroups
        ));
    }

    #[test]
    fn rasterization_is_limited_to_measured_sizes() {
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
            let found = [Packets::BySubgroups, Packets::ByGroups]
                .map(|how| is_rasterization_faster(&params(triangles, size), how));
            let expected = [by_subgroups, by_groups];
            assert_eq!(found, expected, "{triangles} triangles, {size:?}");
        }
    }

    #[test]
    fn rasterization_backs_off_and_retries() {
        let mut backoff = RasterBackoff::default();
        let counts = |raster_incomplete| Counts {
            raster_incomplete,
            ..Counts::default()
        };
        backoff.update(&counts(0));
        assert!(backoff.allow(true) && backoff.allow(true));
        backoff.update(&counts(1));
        // Submissions that were already in flight report the same, or nothing, a little later.
        assert!(!backoff.allow(true));
        backoff.update(&counts(1));
        backoff.update(&counts(0));
        let suspended = (0..1000).position(|_| backoff.allow(true));
        assert_eq!(suspended, Some(BACKOFF_TRACES as usize));
        assert!(!backoff.allow(false));
    }
}
