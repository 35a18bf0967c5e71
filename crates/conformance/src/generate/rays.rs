//! Rays of several kinds, each for one purpose. Sums are computed in double precision and rounded once.

use super::meshes::{point, unit};
use crate::stage;
use fastrand::Rng;
use geom::{Animation, Point, Ray, Triangle, is_active};

/// Bits of the exponent of an `f64`.
const EXPONENT: u64 = 0x7ff << 52;

backend::named! {
    /// Part of a triangle to aim at.
    pub enum Target {
        /// A point in the interior.
        Inside = "inside",
        /// A point on an edge.
        Edge = "edge",
        /// A vertex.
        Vertex = "vertex",
    }
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
        /// From a vertex along an edge.
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
        /// The interval starts or ends at the target, or directly before or after it.
        Limited = "limited",
        /// Cannot hit anything: [`Ray::is_valid`] returns `false`.
        Void = "void",
    }
}

/// Returns `count` rays from all sides, each at a target on a random triangle.
///
/// Rays start at most `distance` times the scene's size away.
pub fn aimed(
    animation: &Animation,
    time: f64,
    target: Target,
    distance: f64,
    count: usize,
) -> Vec<Ray> {
    let [_, aims] = Aims::of(animation, time);
    let mut rng = Rng::with_seed(2014);
    let all = std::iter::repeat_with(|| aims.beyond(target, 2.0 * distance, &mut rng));
    all.filter(Ray::is_valid).take(count).collect()
}

/// Returns ray `i` of a scene. Kinds rotate, and so do the interior, an edge and a vertex as targets.
pub(crate) fn turn([near, all]: &[Aims; 2], i: u64, rng: &mut Rng) -> Ray {
    let (i, kinds) = (i as usize, RayKind::ALL.len());
    let (kind, target) = (RayKind::ALL[i % kinds], Target::ALL[i / kinds % 3]);
    let aims = [near, all][rng.usize(..4).min(1)];
    aims.ray(kind, target, rng)
}

/// The active triangles of a scene at one time, as targets.
pub(crate) struct Aims {
    corners: Vec<Triangle>,
    centre: [f64; 3],
    /// Largest distance from the centre along one axis.
    radius: f64,
}

impl Aims {
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

    /// Returns the targets of a scene at a time: without triangles that reach a thousand times as far as most, and all.
    pub(crate) fn of(animation: &Animation, time: f64) -> [Self; 2] {
        let all = stage::triangles(animation, time);
        let size = |t: &Triangle| t.iter().flatten().fold(0.0_f32, |m, x| m.max(x.abs()));
        let mut sizes: Vec<f32> = all.iter().map(size).collect();
        sizes.sort_unstable_by(f32::total_cmp);
        let most = sizes.get(sizes.len() / 2).map_or(0.0, |x| 1000.0 * x);
        let near = all.iter().copied().filter(|t| size(t) <= most).collect();
        [near, all].map(Self::new)
    }

    /// Returns a ray of a kind, which is aimed at `target` if its kind allows. If there is no triangle, returns a
    /// random ray.
    pub(crate) fn ray(&self, kind: RayKind, target: Target, rng: &mut Rng) -> Ray {
        if self.corners.is_empty() {
            return Ray::new([0.0; 3], point(rng).map(|x| x as f32));
        }
        match kind {
            RayKind::AlongAxis => self.along_axis(target, rng),
            RayKind::OnSurface => {
                let from = self.target(Target::Inside, rng).map(|x| x as f32);
                Ray::new(from, point(rng).map(|x| x as f32))
            }
            RayKind::Beyond => self.beyond(target, 2.0_f64.powi(rng.i32(4..30)), rng),
            _ => {
                let [from, at] = self.ends(kind, target, rng);
                bent(towards(from, at), kind, rng)
            }
        }
    }

    /// Returns the start of a ray and the point at which it is aimed.
    fn ends(&self, kind: RayKind, target: Target, rng: &mut Rng) -> [[f64; 3]; 2] {
        let on_rim = |rng: &mut Rng| [Target::Edge, Target::Vertex][rng.usize(..2)];
        let around = |reach: f64, p: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|i| self.centre[i] + reach * p[i])
        };
        match kind {
            RayKind::Random => [(); 2].map(|()| around(1.5 * self.radius, point(rng))),
            RayKind::InPlane => {
                let triangle = self.triangle(rng);
                let (x, y) = (rng.f64(), rng.f64());
                let at = within(triangle, [x.min(y), 1.0 - x.max(y)]);
                let from = within(triangle, [4.0 * unit(rng), 4.0 * unit(rng)]);
                [from, at]
            }
            // From a lattice point of the triangle's parallelogram or beyond.
            RayKind::InPlaneExactly => {
                let triangle = self.triangle(rng);
                let weights = [(); 2].map(|()| f64::from(rng.i32(-4..=4)));
                let at = halves(on_rim(rng), rng);
                [within(triangle, weights), within(triangle, at)]
            }
            // If vertices are multiples of a power of two, the ray passes exactly through its target.
            RayKind::Exactly | RayKind::Limited => {
                let at = within(self.triangle(rng), halves(target, rng));
                let from = around(2.0 * self.radius, point(rng));
                [from.map(|x| self.snapped(x)), at]
            }
            RayKind::Between => {
                let start = on_rim(rng);
                let from = within(self.triangle(rng), halves(start, rng));
                [from, self.target(target, rng)]
            }
            // From before the edge, from its end or from within it.
            RayKind::AlongEdge => {
                let triangle = self.triangle(rng);
                let start = [-1.0, 0.0, 0.5][rng.usize(..3)];
                [within(triangle, [start, 0.0]), triangle[1]]
            }
            // From around the scene, or from within it.
            _ => {
                let reach = self.radius * [0.9, 2.5][rng.usize(..2)];
                [around(reach, point(rng)), self.target(target, rng)]
            }
        }
    }

    fn triangle(&self, rng: &mut Rng) -> [[f64; 3]; 3] {
        let t = self.corners[rng.usize(..self.corners.len())];
        t.map(|p| p.map(f64::from))
    }

    fn target(&self, target: Target, rng: &mut Rng) -> [f64; 3] {
        let triangle = self.triangle(rng);
        let (x, y) = (rng.f64(), rng.f64());
        let weights = match target {
            Target::Vertex => [0.0, 0.0],
            Target::Edge => [x, 0.0],
            Target::Inside => [x.min(y), 1.0 - x.max(y)],
        };
        within(triangle, weights)
    }

    /// Returns the nearest multiple of a power of two between a 32nd and a 16th of the scene's size.
    fn snapped(&self, x: f64) -> f64 {
        let step = f64::from_bits((self.radius / 16.0).to_bits() & EXPONENT);
        match step > 0.0 {
            true => (x / step).round() * step,
            false => x,
        }
    }

    /// Returns a ray along an axis, which shares its other coordinates with the target.
    fn along_axis(&self, target: Target, rng: &mut Rng) -> Ray {
        let axis = rng.usize(..3);
        let sign = [1.0, -1.0][rng.usize(..2)];
        let mut from = self.target(target, rng);
        from[axis] -= 4.0 * sign * self.radius;
        let mut direction = [(); 3].map(|()| [0.0, -0.0][rng.usize(..2)]);
        direction[axis] = sign as f32 * [1.0, 0.3, 1e-3][rng.usize(..3)];
        Ray::new(from.map(|x| x as f32), direction)
    }

    /// Returns a ray that starts at most `times` the scene's size away.
    fn beyond(&self, target: Target, times: f64, rng: &mut Rng) -> Ray {
        let (from, at) = (point(rng), self.target(target, rng));
        let reach = times * self.radius;
        towards(std::array::from_fn(|i| at[i] + reach * from[i]), at)
    }
}

/// Returns the point of a triangle with these weights of its second and third vertex.
fn within([a, b, c]: [[f64; 3]; 3], [v, w]: [f64; 2]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]))
}

/// Returns weights of the second and third vertex: of a vertex, the midpoint of an edge or an interior point.
fn halves(target: Target, rng: &mut Rng) -> [f64; 2] {
    let vertices = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let edges = [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]];
    match target {
        Target::Vertex => vertices[rng.usize(..3)],
        Target::Edge => edges[rng.usize(..3)],
        Target::Inside => [0.25, 0.25],
    }
}

fn towards(from: [f64; 3], at: [f64; 3]) -> Ray {
    let origin: Point = from.map(|x| x as f32);
    let to = std::array::from_fn(|i| (at[i] - f64::from(origin[i])) as f32);
    Ray::new(origin, to)
}

/// Returns a ray whose origin and direction consist of zeros and small numbers.
pub(crate) fn of_zeros(rng: &mut Rng) -> Ray {
    const FROM: [f32; 8] = [0.0, -0.0, 0.25, -0.25, 0.5, -0.5, 2.0, -2.0];
    const ALONG: [f32; 6] = [0.0, -0.0, 1.0, -1.0, 0.5, -0.25];
    let origin = [(); 3].map(|()| FROM[rng.usize(..FROM.len())]);
    Ray::new(origin, [(); 3].map(|()| ALONG[rng.usize(..ALONG.len())]))
}

/// Applies the limits or the direction that the ray's kind requires.
fn bent(mut ray: Ray, kind: RayKind, rng: &mut Rng) -> Ray {
    let (d, axis) = (&mut ray.direction, rng.usize(..3));
    match kind {
        RayKind::Limited => {
            let at = [1.0_f32.next_down(), 1.0, 1.0_f32.next_up()][rng.usize(..3)];
            match rng.usize(..3) {
                0 => ray.t_max = at,
                1 => ray.t_min = at,
                _ => (ray.t_min, ray.t_max) = (f32::NEG_INFINITY, at - 1.0),
            }
        }
        RayKind::ZeroComponent => d[axis] = [0.0, -0.0][rng.usize(..2)],
        RayKind::Lopsided => {
            d[axis] *= 1e-25;
            d[(axis + 1) % 3] *= [1.0, 1e-12, 1e-38, 1e-6][rng.usize(..4)];
        }
        RayKind::Short => *d = stretched(*d, 1e-30),
        RayKind::Long => *d = stretched(*d, 1e30),
        RayKind::Subnormal => *d = stretched(*d, 3e-41),
        RayKind::Void => return void(ray, rng),
        _ => {}
    }
    ray
}

/// Scales a direction so that its largest component is about `length`.
fn stretched(direction: Point, length: f64) -> Point {
    let d = direction.map(f64::from);
    let longest = d.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    d.map(|x| (x / longest * length) as f32)
}

/// Returns a ray that can hit nothing.
fn void(ray: Ray, rng: &mut Rng) -> Ray {
    let (mut void, axis) = (ray, rng.usize(..3));
    match rng.usize(..7) {
        0 => void.direction = [0.0, -0.0, 0.0],
        1 => void.direction[axis] = f32::NAN,
        2 => void.direction[axis] = f32::NEG_INFINITY,
        3 => void.origin[axis] = [f32::INFINITY, f32::NAN][rng.usize(..2)],
        4 => (void.t_min, void.t_max) = (2.0, 2.0),
        5 => void.t_min = f32::NAN,
        _ => void.t_max = f32::NAN,
    }
    void
}
