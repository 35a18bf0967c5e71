//! The host's definitions of `wgsl/lib/params.wgsl` and of the buffer `counts`. Tests compare them with the WGSL.

use crate::Shape;
use backend::sah_cost;
use bytemuck::{Pod, Zeroable};
use geom::{Camera, CoordinateRange, Point};

/// Parameters of a dispatch: those that all kernels share, and those of its own. The WGSL file explains each member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(
    missing_docs,
    reason = "each member is explained in wgsl/lib/params.wgsl"
)]
pub struct Params {
    pub eye: [f32; 3],
    pub width: u32,
    pub corner: [f32; 3],
    pub height: u32,
    pub across: [f32; 3],
    pub leaf_triangles_at: u32,
    pub down: [f32; 3],
    pub alpha: f32,
    pub light: [f32; 3],
    pub scale_exponent: i32,
    pub count: u32,
    pub node_count: u32,
    pub zero: u32,
    pub start_row: u32,
    pub start_count: u32,
    pub extreme: u32,
    pub tiny: u32,
    pub spread: u32,
    pub scaled_eye: [f32; 3],
    pub depth_exponent: i32,
    pub column: [f32; 3],
    pub wide_at: u32,
    pub row: [f32; 3],
    pub wide_lanes: u32,
    pub depth: [f32; 3],
    pub wide_root: u32,
    pub pixel_margin: f32,
    pub clearance: f32,
    pub padding: [u32; 2],
    pub own: OwnParams,
}

/// The parameters of one kind of kernel, as words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct OwnParams([u32; 8]);

/// A struct of parameters that only some kernels have: a member of `Params` in `wgsl/lib/params.wgsl`.
pub(crate) trait KernelParams: Pod {}

impl OwnParams {
    fn of<T: KernelParams>(own: T) -> Self {
        let mut words = [0; 8];
        let bytes = bytemuck::bytes_of(&own);
        bytemuck::bytes_of_mut(&mut words)[..bytes.len()].copy_from_slice(bytes);
        Self(words)
    }

    /// Returns the parameters as type `T`, which must be the type that they were created from.
    #[cfg(test)]
    pub(crate) fn get<T: KernelParams>(&self) -> T {
        bytemuck::pod_read_unaligned(&bytemuck::bytes_of(&self.0)[..size_of::<T>()])
    }
}

/// Defines a struct of parameters, whose members the WGSL file explains.
macro_rules! kernel_params {
    ($($(#[$doc:meta])* $type:ident = $name:literal { $($field:ident),+ })+) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
            #[repr(C)]
            pub(crate) struct $type {
                $(pub(crate) $field: u32,)+
            }

            impl KernelParams for $type {}
        )+

        /// The name of each struct, its member of `Params`, and its own members.
        #[cfg(test)]
        const OWN: &[(&str, &str, &[&str])] = &[
            $((stringify!($type), $name, &[$(stringify!($field)),+]),)+
        ];
    };
}

kernel_params! {
    /// Parameters of kernels that search along rays or resolve undecided rays.
    SearchParams = "search" { undecided_rays_at, undecided_shadows_at, fallback_workers, candidate_capacity }
    /// Parameters of kernels that rasterize.
    RasterParams = "raster" { tile_capacity }
    /// Parameters of kernels that trace extreme rays, which need exact arithmetic: see [`CoordinateRange::is_extreme`].
    ExtremesParams = "extremes" { rule, answer_words }
    /// Parameters of `measure_range`.
    MeasureParams = "measure" { sample_step }
    /// Parameters of `gather_corners`, and of kernels that compute records and boxes of treelets.
    TreeletsParams = "treelets" { first, uses_list, treelet_count, sum_counter }
    /// Parameters of `sum_costs`.
    SumParams = "sum" { counter }
    /// Parameters of `interpolate`.
    InterpolationParams = "interpolation" { uses_list }
    /// Parameters of `copy_points`.
    PointsParams = "points" { source_at, target_at }
    /// Parameters of kernels that sort.
    SortParams = "sort" { source_at, target_at, shift }
    /// Parameters of `cluster`.
    PhaseParams = "phase" { first_tile, source_at, target_at, tile_offset, clusters_per_tile, search_rounds }
    /// Parameters of `count_answers`.
    AnswerParams = "answer" { words, word, miss, counter }
}

impl Params {
    /// Returns parameters for a scene scaled by `2^-scale_exponent` and a tree of this shape. The exponent is in
    /// -126..=126.
    pub fn of(scale_exponent: i32, tree: &Shape) -> Self {
        Self {
            scale_exponent,
            clearance: f32::INFINITY,
            ..tree.params
        }
    }

    /// Sets the parameters of one kind of kernel.
    pub(crate) fn with<T: KernelParams>(self, own: T) -> Self {
        let own = OwnParams::of(own);
        Self { own, ..self }
    }

    /// Returns the part that [`crate::MODULE`] reads.
    #[must_use]
    pub fn for_module(&self) -> Self {
        Self {
            scale_exponent: self.scale_exponent,
            node_count: self.node_count,
            extreme: self.extreme,
            tiny: self.tiny,
            spread: self.spread,
            ..Self::default()
        }
    }

    /// Sets the range of the coordinates. `None` lets the device measure it; [`Params::spread`] then keeps its value.
    pub fn with_range(mut self, range: Option<CoordinateRange>) -> Self {
        match range {
            Some(range) => {
                self.clearance = range.clearance * scale(self.scale_exponent);
                (self.extreme, self.tiny) = (range.extreme.into(), range.tiny.into());
                self.spread = range.spread.into();
            }
            None => self.extreme = Self::UNKNOWN,
        }
        self
    }

    /// Replaces an unknown range by an ordinary one. Only rays with extreme origins are then extreme.
    pub(crate) fn without_unknown_range(mut self) -> Self {
        if self.has_unknown_range() {
            self.extreme = 0;
        }
        self
    }

    /// Returns whether the host does not know which rays are extreme. The device then reads
    /// [`crate::BufferName::Range`].
    pub fn has_unknown_range(&self) -> bool {
        self.extreme == Self::UNKNOWN
    }

    /// Value of [`Params::extreme`] if [`crate::BufferName::Range`] holds whether rays are extreme.
    pub(crate) const UNKNOWN: u32 = 2;

    /// Returns whether a ray from `origin`, in scene units, is extreme.
    pub fn is_extreme(&self, origin: Point) -> bool {
        let range = CoordinateRange {
            extreme: self.extreme == 1,
            tiny: self.tiny != 0,
            spread: self.spread == 1,
            clearance: self.clearance,
        };
        range.is_extreme(scaled_point(origin, self.scale_exponent))
    }

    /// Sets the camera.
    pub(crate) fn with_camera(mut self, camera: &Camera) -> Self {
        (self.eye, self.corner) = (camera.eye, camera.corner);
        (self.across, self.down) = (camera.across, camera.down);
        (self.width, self.height) = (camera.width, camera.height);
        self.scaled_eye = scaled_point(camera.eye, self.scale_exponent);
        self
    }

    /// Sets the light.
    pub(crate) fn with_light(mut self, light: Point) -> Self {
        self.light = scaled_point(light, self.scale_exponent);
        self
    }
}

/// Counters that the kernels of a submission increment, in the layout of the buffer `counts`.
/// The buffer is cleared before the submission's first stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Counts {
    /// Leaves whose triangle is inactive, by `preprocess_treelets*` or `cluster_leaves`.
    pub inactive: u32,
    /// Leaves whose triangle is active but of zero area, by the same kernels.
    pub degenerate: u32,
    /// Rays that hit. The kernel that stores a ray's result counts it, or `count_answers` afterwards.
    pub hits: u32,
    /// Hits in shadow. The kernel that stores the shadow counts it, or `count_answers` afterwards.
    pub blocked: u32,
    /// Sum of the half areas of all nodes except the root, in scaled units, by the last refit or build.
    pub areas: f32,
    /// The root's half area, in scaled units.
    pub root_area: f32,
    /// Counterpart of `areas` for the candidate tree that is evaluated next to the current one. Both have the same root box.
    pub candidate_areas: f32,
    /// Rays that the first pass of `exact` left undecided, and all extreme rays and their shadow rays.
    pub undecided: u32,
    /// Shadow rays that the first pass of `exact` left undecided.
    pub undecided_shadows: u32,
    /// Candidates for which searches requested space, including those of rays that were decided later and those that
    /// did not fit.
    pub candidates: u32,
    /// Rays that `fallback_*` resolves, for `exact`.
    pub fallback_rays: u32,
    /// Shadow rays that their candidates did not decide, for `exact`.
    pub fallback_shadows: u32,
    /// Tiles for which `cover_small` and `cover_large` requested space, including those that did not fit.
    pub tiles: u32,
    /// Triangles that were too large for `cover_small`.
    pub large: u32,
    /// Approximate number of ray-triangle tests in `rasterize*`.
    pub tests: u32,
    /// 1 if rasterization was incomplete, so that `resolve` traverses the tree: see [`crate::RasterBackoff`].
    pub raster_incomplete: u32,
    /// 1 if `trace_rays` or `any_rays` met an extreme ray.
    pub found_extreme: u32,
    /// 2 if `measure_range` found coordinates of very different sizes, 1 if it did not, 0 if it did not run.
    pub spread: u32,
}

impl Counts {
    /// Adds the hits, hits in shadow and undecided rays of a further trace of the same submission.
    pub fn add_trace(&mut self, other: &Self) {
        self.hits += other.hits;
        self.blocked += other.blocked;
        self.undecided += other.undecided;
    }

    /// Returns whether coordinates have very different sizes, if `measure_range` ran.
    pub fn is_spread(&self) -> Option<bool> {
        (self.spread > 0).then_some(self.spread == 2)
    }

    /// Returns the cost of a tree whose nodes except the root have these half areas. See [`sah_cost`].
    pub fn cost(&self, areas: f32) -> Option<f64> {
        let root = f64::from(self.root_area);
        sah_cost(f64::from(areas) + root, root)
    }

    /// Returns the number of undecided and extreme rays, including shadow rays: see
    /// [`backend::FrameReport::exact_rays`].
    pub fn exact_rays(&self) -> u64 {
        u64::from(self.undecided) + u64::from(self.undecided_shadows)
    }
}

/// Returns `2^-exponent`, by which a scene is scaled ("Scale" in `docs/design/hits.md`). The exponent is in -126..=126.
pub(crate) fn scale(exponent: i32) -> f32 {
    f32::from_bits(((127 - exponent) as u32) << 23)
}

/// Returns a point in scaled units. Coordinates below `2^-64` become zero.
pub(crate) fn scaled_point(point: Point, exponent: i32) -> Point {
    let (by, least) = (scale(exponent), scale(64));
    point.map(|x| {
        let scaled = x * by;
        if scaled.abs() < least { 0.0 } else { scaled }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{KERNELS, Kernel};
    use std::mem::offset_of;

    /// Parses a kernel's WGSL.
    fn module_of(kernel: &Kernel) -> naga::Module {
        naga::front::wgsl::parse_str(kernel.code.wgsl).unwrap()
    }

    /// Returns the members of a struct, and its size in bytes.
    fn layout<'a>(module: &'a naga::Module, name: &str) -> (&'a [naga::StructMember], u32) {
        let mut types = module.types.iter();
        let found = types.find(|(_, t)| t.name.as_deref() == Some(name));
        match &found.unwrap().1.inner {
            naga::TypeInner::Struct { members, span } => (members, *span),
            _ => panic!("{name} is no struct"),
        }
    }

    #[test]
    fn params_match_kernel_sources() {
        let mut found = Vec::new();
        for kernel in KERNELS {
            let module = module_of(kernel);
            let (all, size) = layout(&module, "Params");
            let offset = |name: &str| {
                let member = all.iter().find(|m| m.name.as_deref() == Some(name));
                member.unwrap().offset as usize
            };
            macro_rules! same { ($($field:ident)*) => { $(
                assert_eq!(offset(stringify!($field)), offset_of!(Params, $field), "{}", stringify!($field));
            )* } }
            same!(eye width corner height across leaf_triangles_at down alpha light scale_exponent
                  count node_count zero start_row start_count extreme tiny spread scaled_eye
                  depth_exponent column wide_at row wide_lanes depth wide_root pixel_margin clearance);
            let has_own = kernel.parameters.is_some();
            assert_eq!(all.len(), 28 + usize::from(has_own), "{}", kernel.name);
            assert!(size as usize <= size_of::<Params>(), "{}", kernel.name);
            let own = all.last().unwrap();
            let Some(name) = kernel.parameters else {
                assert_eq!(own.name.as_deref(), Some("clearance"), "{}", kernel.name);
                continue;
            };
            let (of, _, fields) = OWN.iter().find(|(_, of, _)| *of == name).unwrap();
            assert_eq!(own.name.as_deref(), Some(name), "{}", kernel.name);
            assert_eq!(own.offset as usize, offset_of!(Params, own));
            let (members, _) = layout(&module, of);
            let members = members.iter().map(|m| (m.offset, m.name.clone().unwrap()));
            let expected = (0..).step_by(4).zip(fields.iter().map(|f| (*f).to_owned()));
            assert!(members.eq(expected), "{}", kernel.name);
            found.push(name);
        }
        assert!(OWN.iter().all(|(_, name, _)| found.contains(name)));
    }

    #[test]
    fn counters_match_kernel_sources() {
        let wgsl = include_str!("../wgsl/lib/counters.wgsl");
        let word = |name: &str| {
            let text = wgsl.split_once(&format!("const {name}: u32 = ")).unwrap().1;
            let text = text.split_once("u;").unwrap().0;
            4 * text.parse::<usize>().unwrap()
        };
        macro_rules! same { ($($name:ident $member:ident)*) => { $(
            assert_eq!(word(stringify!($name)), offset_of!(Counts, $member), "{}", stringify!($name));
        )* } }
        same!(INACTIVE_COUNT inactive DEGENERATE_COUNT degenerate HIT_COUNT hits OCCLUDED_COUNT blocked
              ROOT_AREA root_area UNDECIDED_RAYS undecided UNDECIDED_SHADOWS undecided_shadows CANDIDATE_COUNT candidates TILE_COUNT tiles
              LARGE_TRIANGLE_COUNT large TEST_COUNT tests RASTER_INCOMPLETE raster_incomplete FOUND_EXTREME found_extreme SIZE_SPREAD spread);
        let [undecided_offset, fallback_offset] = ["UNDECIDED_OFFSET", "FALLBACK_OFFSET"].map(word);
        let counts = [offset_of!(Counts, hits), offset_of!(Counts, blocked)];
        let lists = [
            offset_of!(Counts, undecided),
            offset_of!(Counts, undecided_shadows),
        ];
        assert_eq!(counts.map(|count| count + undecided_offset), lists);
        let fallback_counts = [
            offset_of!(Counts, fallback_rays),
            offset_of!(Counts, fallback_shadows),
        ];
        assert_eq!(lists.map(|list| list + fallback_offset), fallback_counts);
    }

    #[test]
    fn light_is_scaled_and_flushed() {
        let point = [3.0e-3, f32::MIN_POSITIVE, -2.0e-39];
        let (least, none) = ((-64_f32).exp2(), Shape::default());
        for k in -126..=126 {
            let params = Params::of(k, &none).with_light(point);
            let exact = point.map(|x| f64::from(x) * (-f64::from(k)).exp2());
            let snap = |x: f64| {
                if x.abs() < f64::from(least) {
                    0.0
                } else {
                    x as f32
                }
            };
            let snapped = exact.map(snap);
            let found = params.light.map(f32::to_bits);
            assert_eq!(found, snapped.map(f32::to_bits), "{k}");
        }
        let odd = Params::of(3, &none).with_light([f32::NAN, f32::INFINITY, 0.0]);
        assert!(odd.light[0].is_nan() && odd.light[1] == f32::INFINITY);
    }
}
