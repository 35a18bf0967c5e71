//! A ray with a margin, and a triangle: what is sure, and what is not.

use geom::Point;

pub(super) type Vector = [f64; 3];

/// A ray, in double precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) origin: Vector,
    pub(super) direction: Vector,
    pub(super) t_min: f64,
    pub(super) t_max: f64,
    /// How far it may pass from where it should.
    pub(super) margin: f64,
}

/// What a ray does with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Misses it by more than the margin.
    Missed,
    /// May hit it, at about `t`.
    Maybe { t: f64, slack: f64 },
    /// Hits it by more than the margin, at about `t`.
    Hit { t: f64, slack: f64 },
}

impl Line {
    pub(super) fn at(&self, t: f64) -> Vector {
        std::array::from_fn(|i| self.origin[i] + t * self.direction[i])
    }

    pub(super) fn meets(&self, corners: &[Vector; 3]) -> Verdict {
        let from_origin = corners.map(|p| sub(p, self.origin));
        let (inside, height) = self.inside(from_origin);
        if inside < -self.margin {
            return Verdict::Missed;
        }
        let (t, slack) = self.about(from_origin, height);
        if t + slack < self.t_min || t - slack > self.t_max {
            return Verdict::Missed;
        }
        let within = t - slack > self.t_min && t + slack < self.t_max;
        match inside > self.margin && within {
            true => Verdict::Hit { t, slack },
            false => Verdict::Maybe { t, slack },
        }
    }

    /// Where along the line the triangle is, and how far off that may be told: the depths of the
    /// corners are as far off as the margin, and mixed by weights that are off the more, the
    /// narrower the triangle looks from there.
    fn about(&self, corners: [Vector; 3], height: f64) -> (f64, f64) {
        let square = dot(self.direction, self.direction);
        let depths = corners.map(|p| dot(p, self.direction) / square);
        let low = depths.into_iter().fold(f64::INFINITY, f64::min);
        let high = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let [a, b, c] = corners;
        let normal = cross(sub(b, a), sub(c, a));
        let t = dot(normal, a) / dot(normal, self.direction);
        let t = if t.is_finite() { t } else { low };
        let slack = 2.0 * self.margin / square.sqrt() + self.blur(height) * (high - low);
        (t.clamp(low, high), slack)
    }

    /// How far off the weights of a triangle's corners may be, which looks so high at its narrowest.
    pub(super) fn blur(&self, height: f64) -> f64 {
        match height > 0.0 {
            true => (4.0 * self.margin / height).min(1.0),
            false => 1.0,
        }
    }

    /// How far inside the triangle the line passes (negative: how far outside), and how high the
    /// triangle looks from there at its narrowest.
    pub(super) fn inside(&self, corners: [Vector; 3]) -> (f64, f64) {
        let [x, y] = across(self.direction);
        let [a, b, c] = corners.map(|p| [dot(p, x), dot(p, y)]);
        let area = cross2(sub2(b, a), sub2(c, a));
        let edges = [[a, b], [b, c], [c, a]];
        let longest = edges.map(|[p, q]| length2(sub2(q, p)));
        let height = area.abs() / longest.into_iter().fold(0.0, f64::max);
        let depth = edges
            .map(|[p, q]| cross2(p, q) * area.signum() / length2(sub2(q, p)))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        if depth > 0.0 && area != 0.0 {
            return (depth, height);
        }
        let outside = edges.map(|[p, q]| to_segment(p, q));
        (-outside.into_iter().fold(f64::INFINITY, f64::min), height)
    }
}

/// From a point to a closed triangle.
pub(super) fn distance_to_triangle(p: Vector, corners: &[Vector; 3]) -> f64 {
    let [a, b, c] = corners.map(|q| sub(q, p));
    let normal = cross(sub(b, a), sub(c, a));
    let edges = [[a, b], [b, c], [c, a]];
    // Whether the point lies above the inside, seen from either side of the plane.
    let above = |[q, r]: [Vector; 2]| dot(cross(q, r), normal) > 0.0;
    if edges.into_iter().all(above) {
        return dot(a, unit(normal)).abs();
    }
    let to_edge = edges.map(|[q, r]| {
        let way = sub(r, q);
        let square = dot(way, way);
        let s = match square > 0.0 {
            true => (-dot(q, way) / square).clamp(0.0, 1.0),
            false => 0.0,
        };
        let nearest: Vector = std::array::from_fn(|i| q[i] + s * way[i]);
        dot(nearest, nearest).sqrt()
    });
    to_edge.into_iter().fold(f64::INFINITY, f64::min)
}

/// From the origin to a segment.
fn to_segment(p: [f64; 2], q: [f64; 2]) -> f64 {
    let way = sub2(q, p);
    let square = way[0] * way[0] + way[1] * way[1];
    let s = match square > 0.0 {
        true => (-(p[0] * way[0] + p[1] * way[1]) / square).clamp(0.0, 1.0),
        false => 0.0,
    };
    length2([p[0] + s * way[0], p[1] + s * way[1]])
}

/// Two directions of length 1 across a third and across each other.
fn across(d: Vector) -> [Vector; 2] {
    let least = (0..3).min_by(|&i, &j| d[i].abs().total_cmp(&d[j].abs()));
    let mut helper = [0.0; 3];
    helper[least.unwrap_or(0)] = 1.0;
    let x = unit(cross(d, helper));
    [x, unit(cross(d, x))]
}

pub(super) fn wide(p: Point) -> Vector {
    p.map(f64::from)
}

pub(super) fn sub(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

pub(super) fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

pub(super) fn unit(a: Vector) -> Vector {
    let length = length(a);
    a.map(|x| x / length)
}

pub(super) fn sub2(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn cross2(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn length2(a: [f64; 2]) -> f64 {
    a[0].hypot(a[1])
}
