//! Ray-triangle tests, and the searches that every test offers.

mod exact;
mod moller_trumbore;
mod watertight;
mod woop;

pub(crate) use exact::Candidate;
pub use exact::{DEPTH, Exact, SHEAR, SMALL};
pub use moller_trumbore::MollerTrumbore;
pub use watertight::{Watertight, has_equal_signs};
pub use woop::Woop;

/// Evaluates an expression in which `$Test` is the test of an intersector. The expression is compiled once for each.
macro_rules! by_test {
    ($intersector:expr, $Test:ident => $value:expr) => {{
        use backend::Intersector;
        use $crate::intersect::{Exact, MollerTrumbore, Watertight, Woop};
        match $intersector {
            Intersector::MollerTrumbore => {
                type $Test = MollerTrumbore;
                $value
            }
            Intersector::Woop => {
                type $Test = Woop;
                $value
            }
            Intersector::Watertight => {
                type $Test = Watertight;
                $value
            }
            Intersector::Exact => {
                type $Test = Exact;
                $value
            }
        }
    }};
}
pub(crate) use by_test;

use crate::Geometry;
use crate::extreme::Rule;
use crate::scale::{PreparedRay, Scale};
use crate::traverse::{Stack, Tree, meet_leaf};
use geom::exact::Line;
use geom::{Hit, Ray, Triangle};
use std::sync::atomic::AtomicU64;

/// A preprocessed triangle: 48 bytes, three rows of four floats. Each test defines their meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Record(pub [[f32; 4]; 3]);

/// Intersection of a ray with a triangle, before `t` is clamped to the triangle's box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Distance in scaled units.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
}

/// A ray-triangle test. It is a type parameter, so loops are compiled separately for each test.
pub trait TriangleTest {
    /// Exact rule for extreme rays, or `None` if the test handles them like other rays.
    const EXTREMES: Option<Rule> = None;

    /// A ray, prepared for the test.
    type Ray: Copy;

    /// Preprocesses an active, non-degenerate triangle, given in scaled units.
    fn record(corners: &Triangle) -> Record;

    /// Prepares a ray.
    fn prepare(ray: &PreparedRay) -> Self::Ray;

    /// Intersects the ray's whole line with the triangle. The caller clamps `t` and applies the limits.
    fn meet(ray: &Self::Ray, record: &Record) -> Option<Meeting>;
}

/// The triangle data that an intersector reads.
pub(crate) trait Preprocess {
    /// Preprocesses an active, non-degenerate triangle, given in scaled units.
    fn record(corners: &Triangle) -> Record;
}

impl<T: TriangleTest> Preprocess for T {
    fn record(corners: &Triangle) -> Record {
        T::record(corners)
    }
}

/// The exact test filters by the watertight test's numbers.
impl Preprocess for Exact {
    fn record(corners: &Triangle) -> Record {
        <Watertight as TriangleTest>::record(corners)
    }
}

/// A ray with the scene to trace it in.
#[derive(Clone, Copy)]
pub struct Asked<'a, N> {
    /// Boxes and triangles.
    pub tree: N,
    /// Corners of the triangles.
    pub geometry: Geometry<'a>,
    /// The ray, in units of the scene divided by `scale`.
    pub ray: Ray,
    /// Conversion from the ray's units to scaled units.
    pub scale: Scale,
    /// Counts rays that were resolved in exact arithmetic.
    pub settled: &'a AtomicU64,
}

impl<N> Asked<'_, N> {
    /// Converts the ray to the input of exact arithmetic.
    pub(crate) fn line(&self) -> Line {
        Line {
            ray: self.ray,
            shift: self.geometry.scale.k() - self.scale.k(),
        }
    }
}

/// The searches of an intersector.
pub trait Search<N: Tree> {
    /// Exact rule for extreme rays, or `None` if they are searched like other rays.
    const EXTREMES: Option<Rule>;

    /// Returns the closest hit, with `t` in the ray's own units.
    fn closest(asked: &Asked<'_, N>, stack: &mut Stack<N>) -> Option<Hit>;

    /// Returns whether the ray hits any triangle except `skipped`.
    fn any(asked: &Asked<'_, N>, skipped: Option<u32>, stack: &mut Stack<N>) -> bool;
}

impl<N: Tree, T: TriangleTest> Search<N> for T {
    const EXTREMES: Option<Rule> = T::EXTREMES;

    fn closest(asked: &Asked<'_, N>, stack: &mut Stack<N>) -> Option<Hit> {
        let (tree, ray) = (asked.tree, PreparedRay::new(&asked.ray, asked.scale)?);
        let test = T::prepare(&ray);
        let mut best = Hit {
            t: ray.t_max,
            ..Hit::MISS
        };
        tree.visit(&ray, &mut stack.waiting, |leaf, _| {
            if let Some(Meeting { t, u, v }) = meet_leaf::<T>(tree, (&ray, &test), leaf)
                && t <= best.t
            {
                let triangle = tree.triangle(leaf.place).unwrap_or(best.triangle);
                let hit = Hit { t, u, v, triangle };
                if hit.is_before(&best) {
                    best = hit;
                }
            }
            Some(best.t)
        });
        let t = ray.unscaled(best.t);
        best.is_hit().then_some(Hit { t, ..best })
    }

    fn any(asked: &Asked<'_, N>, skipped: Option<u32>, stack: &mut Stack<N>) -> bool {
        let Some(ray) = PreparedRay::new(&asked.ray, asked.scale) else {
            return false;
        };
        let (tree, test) = (asked.tree, T::prepare(&ray));
        tree.visit(&ray, &mut stack.waiting, |leaf, bound| {
            let hit = meet_leaf::<T>(tree, (&ray, &test), leaf).is_some()
                && (skipped.is_none() || tree.triangle(leaf.place) != skipped);
            (!hit).then_some(bound)
        })
    }
}
