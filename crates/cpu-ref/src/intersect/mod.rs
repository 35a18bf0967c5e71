//! Ray-triangle tests, and what it means to ask one ray, whatever the test.

mod exact;
mod moller_trumbore;
mod watertight;
mod woop;

pub(crate) use exact::Candidate;
pub use exact::{DEPTH, Exact, SHEAR, SMALL};
pub use moller_trumbore::MollerTrumbore;
pub use watertight::{Watertight, has_equal_signs};
pub use woop::Woop;

use crate::Geometry;
use crate::extreme::Rule;
use crate::scale::{PreparedRay, Scale};
use crate::traverse::{Stack, Tree, meet_leaf};
use ::exact::Line;
use geom::{Hit, Ray, Triangle};
use std::sync::atomic::AtomicU64;

/// What `preprocess` keeps of a triangle: 48 bytes, three rows of four, each test's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Record(pub [[f32; 4]; 3]);

/// Where a ray meets a triangle, before the clamp to its box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Distance in scaled units.
    pub t: f32,
    /// Weight of the second vertex.
    pub u: f32,
    /// Weight of the third vertex.
    pub v: f32,
}

/// A ray-triangle test, chosen when the program is compiled: loops are made once for each.
pub trait TriangleTest {
    /// How extreme rays are answered, if in exact arithmetic.
    const EXTREMES: Option<Rule> = None;

    /// What the test needs of a ray.
    type Ray: Copy;

    /// Prepares a triangle in scaled units, active and not degenerate.
    fn record(corners: &Triangle) -> Record;

    /// Prepares a ray.
    fn prepare(ray: &PreparedRay) -> Self::Ray;

    /// Where the ray meets the triangle, anywhere along its line; the caller clamps and limits `t`.
    fn meet(ray: &Self::Ray, record: &Record) -> Option<Meeting>;
}

/// A ray and all it can meet.
#[derive(Clone, Copy)]
pub struct Asked<'a, N> {
    /// Boxes and triangles.
    pub tree: N,
    /// Where triangles are.
    pub geometry: Geometry<'a>,
    /// The ray, in units of the scene divided by `scale`.
    pub ray: Ray,
    /// From the ray's units to scaled units.
    pub scale: Scale,
    /// Counts rays that exact arithmetic settled.
    pub settled: &'a AtomicU64,
}

impl<N> Asked<'_, N> {
    /// The ray as exact arithmetic takes it.
    pub(crate) fn line(&self) -> Line {
        Line {
            ray: self.ray,
            shift: self.geometry.scale.k() - self.scale.k(),
        }
    }
}

/// An intersector as the tracer sees it.
pub trait Search<N: Tree> {
    /// How extreme rays are answered, if in exact arithmetic.
    const EXTREMES: Option<Rule>;

    /// The closest hit, `t` in the ray's own units.
    fn closest(asked: &Asked<'_, N>, stack: &mut Stack<N>) -> Option<Hit>;

    /// Whether the ray hits any triangle but `skipped`.
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
