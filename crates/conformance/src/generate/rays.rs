//! Rays of several kinds, each for one purpose. Sums are computed in double precision and rounded once.

use super::meshes::point;
use super::strategies::{LastOf, Precision, last_of, precision, runner, value_tree};
use crate::stage;
use geom::{Animation, Point, Ray, Triangle, is_active};
use proptest::array::uniform3;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::strategy::ValueTree;

/// Bits of the exponent of an `f64`.
const EXPONENT: u64 = 0x7ff << 52;

/// Part of a triangle to aim at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A point in the interior.
    Inside,
    /// A point on an edge.
    Edge,
    /// A vertex.
    Vertex,
}

impl Target {
    /// All targets.
    pub const ALL: [Self; 3] = [Self::Inside, Self::Edge, Self::Vertex];
}

backend::named! {
    /// Purpose of a ray.
    pub enum RayKind {
        /// Random ray through the scene.
        Random = "random",
        /// From around the scene, or from within it, to a target.
        Aimed = "aimed",
        /// From a grid point in or around the scene to a target, so that the ray can pass exactly through it.
        Exactly = "exactly",
        /// In the plane of a triangle, towards it.
        InPlane = "in-plane",
        /// In the plane of a triangle, from and to points with exact coordinates.
        InPlaneExactly = "in-plane-exactly",
        /// Along an axis; the other components are zeros of either sign.
        AlongAxis = "along-axis",
        /// Along an edge: from a point before it, from its first vertex or from its midpoint.
        AlongEdge = "along-edge",
        /// From a point on a triangle in any direction.
        OnSurface = "on-surface",
        /// From a vertex or an edge midpoint of one triangle to another triangle.
        Between = "between",
        /// From very far away to a target.
        Beyond = "beyond",
        /// One component of the direction is a zero of either sign.
        ZeroComponent = "zero-component",
        /// Components of the direction differ greatly in size.
        Lopsided = "lopsided",
        /// The direction is very short.
        Short = "short",
        /// The direction is very long.
        Long = "long",
        /// The direction is subnormal.
        Subnormal = "subnormal",
        /// The interval starts or ends at the target, or directly before or after it. Or it extends backwards and ends
        /// near the ray's origin.
        Limited = "limited",
        /// Cannot hit anything: [`Ray::is_valid`] returns `false`.
        Void = "void",
    }
}

/// Description of a ray, from which [`TargetTriangles`] computes it for a scene.
#[derive(Clone, Debug)]
pub(crate) struct RayDescription {
    pub(crate) kind: RayKind,
    target: Target,
    /// Whether the targets exclude triangles that extend far.
    is_near: bool,
    /// Numbers that select the triangle of the target and another triangle, modulo the number of triangles.
    triangles: [u32; 2],
    /// Weights of the target in its triangle.
    weights: [f64; 2],
    /// Vertex or edge of the triangle.
    part: usize,
    /// A random choice whose meaning depends on the kind of ray, such as a vertex instead of an edge.
    choice: bool,
    /// Points around the scene.
    points: [[f64; 3]; 2],
    /// Start of an in-plane ray, as multiples of the edge vectors at the triangle's first vertex.
    walk: [i32; 2],
    /// Binary exponent of the distance at which a [`RayKind::Beyond`] ray starts, in units of the scene's radius.
    exponent: i32,
    axis: usize,
    /// Signs of zeros.
    signs: [bool; 3],
    /// The variant of the kind, modulo the number of variants.
    variant: usize,
    precision: Precision,
}

/// Rays of a kind, which shrink to kinds without special geometry and to fewer digits.
pub(crate) fn rays_of(kind: RayKind, target: Target) -> impl Strategy<Value = RayDescription> {
    let special = (
        0..3_usize,
        uniform3(any::<bool>()),
        0..VARIANTS,
        0..3_usize,
        any::<bool>(),
        [-4..=4, -4..=4],
        4..30,
    );
    let geometry = (
        0..4_u8,
        any::<[u32; 2]>(),
        [0.0..1.0, 0.0..1.0],
        [point(), point()],
    );
    let numbers = (geometry.no_shrink(), special.no_shrink());
    (kinds(kind), precision(), numbers).prop_map(move |(kind, precision, (geometry, special))| {
        let (near, triangles, weights, points) = geometry;
        let (axis, signs, variant, part, choice, walk, exponent) = special;
        RayDescription {
            kind,
            target,
            is_near: near == 0,
            triangles,
            weights,
            part,
            choice,
            points,
            walk,
            exponent,
            axis,
            signs,
            variant,
            precision,
        }
    })
}

/// A multiple of the number of variants of each kind.
const VARIANTS: usize = 9 * 4 * 7;

/// A kind, or the simpler kinds that it shrinks to.
fn kinds(kind: RayKind) -> LastOf<RayKind> {
    let simple = [RayKind::Random, RayKind::Aimed].into_iter();
    let simple = simple.take_while(|&simple| simple != kind);
    last_of(simple.chain([kind]).collect::<Vec<_>>())
}

/// Ray `i` of a scene. Consecutive rays cycle through all kinds, and then through all targets.
pub(crate) fn nth_ray(i: u64) -> impl Strategy<Value = RayDescription> {
    let (i, kinds) = (i as usize, RayKind::ALL.len());
    rays_of(RayKind::ALL[i % kinds], Target::ALL[i / kinds % 3])
}

/// Returns `count` rays from all sides, each at a target on a random triangle.
///
/// Rays start at most `distance` times the scene's size away from their targets, along each axis.
pub fn aimed(
    animation: &Animation,
    time: f64,
    target: Target,
    distance: f64,
    count: usize,
) -> Vec<Ray> {
    let [_, targets] = TargetTriangles::of(animation, time);
    let (rays, mut runner) = (rays_of(RayKind::Beyond, target), runner(2014, 0, 0));
    let ray = || targets.beyond(&value_tree(&rays, &mut runner).current(), 2.0 * distance);
    let all = std::iter::repeat_with(ray);
    all.filter(Ray::is_valid).take(count).collect()
}

/// The active triangles of a scene at one time, as targets.
pub(crate) struct TargetTriangles {
    corners: Vec<Triangle>,
    centre: [f64; 3],
    /// Largest distance from the centre along one axis.
    radius: f64,
}

impl TargetTriangles {
    fn new(corners: Vec<Triangle>) -> Self {
        let corners: Vec<_> = corners.into_iter().filter(is_active).collect();
        let ends = |i: usize| {
            let all = corners.iter().flatten().map(|p| f64::from(p[i]));
            all.fold([f64::MAX, f64::MIN], |[a, b], x| [a.min(x), b.max(x)])
        };
        let ends = [ends(0), ends(1), ends(2)];
        Self {
            centre: ends.map(|[a, b]| 0.5 * (a + b)),
            radius: ends.iter().fold(0.0_f64, |r, [a, b]| r.max(0.5 * (b - a))),
            corners,
        }
    }

    /// Returns two sets of targets among the triangles that are active at a time. The first omits triangles whose
    /// largest coordinate exceeds a thousand times the median. The second omits none.
    pub(crate) fn of(animation: &Animation, time: f64) -> [Self; 2] {
        let all = stage::triangles(animation, time);
        let size = |t: &Triangle| t.iter().flatten().fold(0.0_f32, |m, x| m.max(x.abs()));
        let mut sizes: Vec<f32> = all.iter().map(size).collect();
        sizes.sort_unstable_by(f32::total_cmp);
        let most = sizes.get(sizes.len() / 2).map_or(0.0, |x| 1000.0 * x);
        let near = all.iter().copied().filter(|t| size(t) <= most).collect();
        [near, all].map(Self::new)
    }

    /// Returns the described ray at the targets of a scene: see [`Self::of`].
    pub(crate) fn pick([near, all]: &[Self; 2], ray: &RayDescription) -> Ray {
        let targets = if ray.is_near { near } else { all };
        targets.ray(ray)
    }

    /// Returns the described ray, which is aimed at its target if its kind allows. If there is no triangle, returns a
    /// random ray.
    pub(crate) fn ray(&self, ray: &RayDescription) -> Ray {
        let precise = self.full(ray);
        Ray {
            origin: ray.precision.point(precise.origin),
            direction: ray.precision.point(precise.direction),
            ..precise
        }
    }

    /// Returns the described ray in full precision.
    fn full(&self, ray: &RayDescription) -> Ray {
        let somewhere = ray.points[0].map(|x| x as f32);
        if self.corners.is_empty() {
            return Ray::new([0.0; 3], somewhere);
        }
        match ray.kind {
            RayKind::AlongAxis => self.along_axis(ray),
            RayKind::OnSurface => {
                let from = self.target(Target::Inside, ray).map(|x| x as f32);
                Ray::new(from, somewhere)
            }
            RayKind::Beyond => self.beyond(ray, 2.0_f64.powi(ray.exponent)),
            _ => {
                let [from, at] = self.ends(ray);
                ray.adapted_to_kind(towards(from, at))
            }
        }
    }

    /// Returns the start of a ray and the point at which it is aimed.
    fn ends(&self, ray: &RayDescription) -> [[f64; 3]; 2] {
        let around = |reach: f64, p: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| self.centre[i] + reach * p[i])
        };
        let rim = [Target::Edge, Target::Vertex][usize::from(ray.choice)];
        let triangle = self.triangle(ray.triangles[0]);
        match ray.kind {
            RayKind::Random => ray.points.map(|p| around(1.5 * self.radius, p)),
            RayKind::InPlane => {
                let [x, y, _] = ray.points[0].map(|x| 4.0 * x);
                [within(triangle, [x, y]), self.target(Target::Inside, ray)]
            }
            // From a lattice point in the triangle's plane.
            RayKind::InPlaneExactly => {
                let from = within(triangle, ray.walk.map(f64::from));
                [from, within(triangle, halves(rim, ray.part))]
            }
            // If the coordinates of vertices have few binary digits, as on a grid, all sums here are exact. Then the
            // ray passes exactly through its target.
            RayKind::Exactly | RayKind::Limited => {
                let at = within(triangle, halves(ray.target, ray.part));
                let from = around(2.0 * self.radius, ray.points[0]);
                [from.map(|x| self.snapped(x)), at]
            }
            RayKind::Between => {
                let from = within(self.triangle(ray.triangles[1]), halves(rim, ray.part));
                [from, self.target(ray.target, ray)]
            }
            // From a point before the edge, from the first vertex or from the midpoint.
            RayKind::AlongEdge => {
                let start = [-1.0, 0.0, 0.5][ray.variant % 3];
                [within(triangle, [start, 0.0]), triangle[1]]
            }
            // From around the scene, or from within it.
            _ => {
                let reach = self.radius * [0.9, 2.5][usize::from(ray.choice)];
                [around(reach, ray.points[0]), self.target(ray.target, ray)]
            }
        }
    }

    /// Returns the triangle that `number` selects, modulo the number of triangles.
    fn triangle(&self, number: u32) -> [[f64; 3]; 3] {
        let t = self.corners[number as usize % self.corners.len()];
        t.map(|p| p.map(f64::from))
    }

    fn target(&self, target: Target, ray: &RayDescription) -> [f64; 3] {
        let [x, y] = ray.weights;
        let weights = match target {
            Target::Vertex => [0.0, 0.0],
            Target::Edge => [x, 0.0],
            Target::Inside => [x.min(y), 1.0 - x.max(y)],
        };
        within(self.triangle(ray.triangles[0]), weights)
    }

    /// Rounds to a multiple of the largest power of two up to 1/16 of the scene's radius.
    fn snapped(&self, x: f64) -> f64 {
        let step = f64::from_bits((self.radius / 16.0).to_bits() & EXPONENT);
        if step > 0.0 {
            (x / step).round() * step
        } else {
            x
        }
    }

    /// Returns a ray along an axis, which shares its other coordinates with the target.
    fn along_axis(&self, ray: &RayDescription) -> Ray {
        let sign = if ray.choice { -1.0 } else { 1.0 };
        let mut from = self.target(ray.target, ray);
        from[ray.axis] -= 4.0 * sign * self.radius;
        let mut direction = ray.signs.map(zero);
        direction[ray.axis] = sign as f32 * [1.0, 0.3, 1e-3][ray.variant % 3];
        Ray::new(from.map(|x| x as f32), direction)
    }

    /// Returns a ray that starts at most `times` the scene's radius away from its target, along each axis.
    fn beyond(&self, ray: &RayDescription, times: f64) -> Ray {
        let (from, at) = (ray.points[0], self.target(ray.target, ray));
        let reach = times * self.radius;
        towards(std::array::from_fn(|i| at[i] + reach * from[i]), at)
    }
}

/// Returns a zero of either sign.
fn zero(is_negative: bool) -> f32 {
    if is_negative { -0.0 } else { 0.0 }
}

/// Returns the point of a triangle with these weights of its second and third vertex.
fn within([a, b, c]: [[f64; 3]; 3], [v, w]: [f64; 2]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]))
}

/// Returns the barycentric weights of the second and third vertex, for a vertex, the midpoint of an edge or an
/// interior point.
fn halves(target: Target, part: usize) -> [f64; 2] {
    let vertices = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let edges = [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
    match target {
        Target::Vertex => vertices[part],
        Target::Edge => edges[part],
        Target::Inside => [0.25, 0.25],
    }
}

fn towards(from: [f64; 3], at: [f64; 3]) -> Ray {
    let origin: Point = from.map(|x| x as f32);
    let to = std::array::from_fn(|i| (at[i] - f64::from(origin[i])) as f32);
    Ray::new(origin, to)
}

/// Rays whose coordinates are zeros or a few powers of two, of either sign.
pub(crate) fn of_zeros() -> impl Strategy<Value = Ray> {
    const FROM: [f32; 8] = [0.0, -0.0, 0.25, -0.25, 0.5, -0.5, 2.0, -2.0];
    const ALONG: [f32; 6] = [0.0, -0.0, 1.0, -1.0, 0.5, -0.25];
    let ends = (uniform3(select(&FROM[..])), uniform3(select(&ALONG[..])));
    ends.prop_map(|(origin, direction)| Ray::new(origin, direction))
}

impl RayDescription {
    /// Applies the limits or the direction that the ray's kind requires.
    fn adapted_to_kind(&self, mut ray: Ray) -> Ray {
        let (d, axis) = (&mut ray.direction, self.axis);
        match self.kind {
            RayKind::Limited => {
                let at = [1.0_f32.next_down(), 1.0, 1.0_f32.next_up()][self.variant % 3];
                match self.variant / 3 % 3 {
                    0 => ray.t_max = at,
                    1 => ray.t_min = at,
                    _ => (ray.t_min, ray.t_max) = (f32::NEG_INFINITY, at - 1.0),
                }
            }
            RayKind::ZeroComponent => d[axis] = zero(self.signs[0]),
            RayKind::Lopsided => {
                d[axis] *= 1e-25;
                d[(axis + 1) % 3] *= [1.0, 1e-12, 1e-38, 1e-6][self.variant % 4];
            }
            RayKind::Short => *d = stretched(*d, 1e-30),
            RayKind::Long => *d = stretched(*d, 1e30),
            RayKind::Subnormal => *d = stretched(*d, 3e-41),
            RayKind::Void => return self.void(ray),
            _ => {}
        }
        ray
    }

    /// Returns a ray that can hit nothing.
    fn void(&self, mut ray: Ray) -> Ray {
        let axis = self.axis;
        match self.variant % 7 {
            0 => ray.direction = [0.0, -0.0, 0.0],
            1 => ray.direction[axis] = f32::NAN,
            2 => ray.direction[axis] = f32::NEG_INFINITY,
            3 => ray.origin[axis] = [f32::INFINITY, f32::NAN][usize::from(self.signs[0])],
            4 => (ray.t_min, ray.t_max) = (2.0, 2.0),
            5 => ray.t_min = f32::NAN,
            _ => ray.t_max = f32::NAN,
        }
        ray
    }
}

/// Scales a direction so that its largest component is about `length`.
fn stretched(direction: Point, length: f64) -> Point {
    let d = direction.map(f64::from);
    let longest = d.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    d.map(|x| (x / longest * length) as f32)
}
