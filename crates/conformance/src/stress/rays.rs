//! Rays made for one purpose each. Sums are in double precision and rounded once.

use crate::stress::meshes::{point, unit};
use fastrand::Rng;
use geom::{Point, Ray, Triangle};

/// The bits of an exponent.
const EXPONENT: u64 = 0x7ff << 52;

/// Where on a triangle to aim.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Target {
    Inside,
    Edge,
    Vertex,
}

/// Triangles as they stand at the moment of asking, inactive ones left out.
pub(crate) struct Aims {
    corners: Vec<Triangle>,
    centre: [f64; 3],
    /// The largest distance from the centre on one axis.
    radius: f64,
}

impl Aims {
    pub(crate) fn new(corners: Vec<Triangle>) -> Self {
        let active = |t: &Triangle| t.iter().flatten().all(|x| x.is_finite());
        let corners: Vec<Triangle> = corners.into_iter().filter(active).collect();
        let ends = |i: usize| {
            let all = corners.iter().flatten().map(|p| f64::from(p[i]));
            all.fold([f64::MAX, f64::MIN], |[a, b], x| [a.min(x), b.max(x)])
        };
        let ends = [ends(0), ends(1), ends(2)];
        Self {
            centre: ends.map(|[a, b]| 0.5 * (a + b)),
            radius: ends
                .map(|[a, b]| 0.5 * (b - a))
                .into_iter()
                .fold(0.0, f64::max),
            corners,
        }
    }

    /// Triangles there are to aim at.
    pub(crate) fn count(&self) -> usize {
        self.corners.len()
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

    /// From around the scene, or from within it, to a target.
    pub(crate) fn aimed(&self, target: Target, rng: &mut Rng) -> Ray {
        let reach = self.radius * [0.9, 2.5][rng.usize(..2)];
        let from = point(rng);
        let from = std::array::from_fn(|i| self.centre[i] + reach * from[i]);
        towards(from, self.target(target, rng))
    }

    /// From a point on a triangle in any direction.
    pub(crate) fn on_surface(&self, rng: &mut Rng) -> Ray {
        let from = self.target(Target::Inside, rng).map(|x| x as f32);
        Ray::new(from, point(rng).map(|x| x as f32))
    }

    /// From beyond a triangle, in its plane, to a point of it.
    pub(crate) fn in_plane(&self, rng: &mut Rng) -> Ray {
        let triangle = self.triangle(rng);
        let (x, y) = (rng.f64(), rng.f64());
        let at = within(triangle, [x.min(y), 1.0 - x.max(y)]);
        let from = within(triangle, [4.0 * unit(rng), 4.0 * unit(rng)]);
        towards(from, at)
    }

    /// Along an axis to a target, whose other coordinates are the origin's.
    pub(crate) fn along_axis(&self, target: Target, rng: &mut Rng) -> Ray {
        let axis = rng.usize(..3);
        let sign = [1.0, -1.0][rng.usize(..2)];
        let mut from = self.target(target, rng);
        from[axis] -= 4.0 * sign * self.radius;
        let mut direction = [(); 3].map(|()| [0.0, -0.0][rng.usize(..2)]);
        direction[axis] = sign as f32 * [1.0, 0.3, 1e-3][rng.usize(..3)];
        Ray::new(from.map(|x| x as f32), direction)
    }

    /// Through the scene, at nothing in particular.
    pub(crate) fn random(&self, rng: &mut Rng) -> Ray {
        let mut anywhere = || {
            let p = point(rng);
            std::array::from_fn(|i| self.centre[i] + 1.5 * self.radius * p[i])
        };
        towards(anywhere(), anywhere())
    }

    /// The nearest multiple of a power of two between a 32nd and a 16th of the scene's size.
    fn snapped(&self, x: f64) -> f64 {
        let step = f64::from_bits((self.radius / 16.0).to_bits() & EXPONENT);
        if step > 0.0 {
            (x / step).round() * step
        } else {
            x
        }
    }

    /// From a point whose coordinates are multiples of a power of two to a vertex or the middle of an edge: where
    /// vertices are such points too, the ray passes exactly through what it is aimed at.
    pub(crate) fn aimed_exactly(&self, target: Target, rng: &mut Rng) -> Ray {
        let triangle = self.triangle(rng);
        let at = within(triangle, halves(target, rng));
        let from = point(rng).map(|x| 2.0 * self.radius * x);
        let from = std::array::from_fn(|i| self.snapped(self.centre[i] + from[i]));
        towards(from, at)
    }

    /// Along a face, from a corner of its parallelogram or beyond to a corner or the middle of an edge.
    pub(crate) fn in_plane_exactly(&self, rng: &mut Rng) -> Ray {
        let triangle = self.triangle(rng);
        let weights = [(); 2].map(|()| f64::from(rng.i32(-4..=4)));
        let target = [Target::Edge, Target::Vertex][rng.usize(..2)];
        let at = within(triangle, halves(target, rng));
        towards(within(triangle, weights), at)
    }

    /// From a vertex or an edge of one triangle to another triangle.
    pub(crate) fn between(&self, target: Target, rng: &mut Rng) -> Ray {
        let start = [Target::Edge, Target::Vertex][rng.usize(..2)];
        let from = within(self.triangle(rng), halves(start, rng));
        towards(from, self.target(target, rng))
    }

    /// From so many times the scene's size away.
    pub(crate) fn beyond(&self, target: Target, times: f64, rng: &mut Rng) -> Ray {
        let (from, at) = (point(rng), self.target(target, rng));
        towards(
            std::array::from_fn(|i| at[i] + times * self.radius * from[i]),
            at,
        )
    }

    /// Along an edge, from before it, from its end or from within it.
    pub(crate) fn along_edge(&self, rng: &mut Rng) -> Ray {
        let [a, b, _] = self.triangle(rng);
        let start = [-1.0, 0.0, 0.5][rng.usize(..3)];
        let from = std::array::from_fn(|i| a[i] + start * (b[i] - a[i]));
        towards(from, b)
    }
}

/// The point of a triangle with these weights of its second and third vertex.
fn within([a, b, c]: [[f64; 3]; 3], [v, w]: [f64; 2]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]))
}

/// Weights of the second and third vertex: a vertex, the middle of an edge or a point well inside.
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

/// From a point of zeros and small numbers along others.
pub(crate) fn of_zeros(rng: &mut Rng) -> Ray {
    const FROM: [f32; 8] = [0.0, -0.0, 0.25, -0.25, 0.5, -0.5, 2.0, -2.0];
    const ALONG: [f32; 6] = [0.0, -0.0, 1.0, -1.0, 0.5, -0.25];
    let origin = [(); 3].map(|()| FROM[rng.usize(..FROM.len())]);
    Ray::new(origin, [(); 3].map(|()| ALONG[rng.usize(..ALONG.len())]))
}
