//! Whether an answer lies within rounding of the exact one: for backends that leave what a ray hits to a driver.
//!
//! The Vulkan specification (chapter *Ray Traversal*) leaves the precision of a driver's intersections
//! open; it demands but that they be those of single-precision arithmetic on the given numbers, and that shared
//! edges let no ray through. So a ray may pass up to [`ULPS`] units in the last place of the largest coordinate
//! at hand beside where it should. Everything that such a shift explains is allowed, nothing else is.
//! All here is computed in double precision, whose own rounding is beneath notice.

mod line;

use geom::{Animation, Hit, Point, Ray, is_active};
use line::{Line, Vector, Verdict, distance_to_triangle, length, sub, wide};

/// Units in the last place (`2^-24` of the largest coordinate). The transform by an instance, the shift to the ray's
/// origin, the shear and the edge functions are about 16 roundings; twice that.
const ULPS: f64 = 32.0;

/// Sizes between which products of three coordinates neither overflow nor vanish in single precision.
const TAME: [f32; 2] = [1e-9, 1e9];

/// The triangles of a scene as they stand at a time.
pub(crate) struct Verifier {
    /// Active ones, with their indices.
    triangles: Vec<(u32, [Vector; 3])>,
    /// The largest coordinate of all.
    size: f64,
}

impl Verifier {
    pub(crate) fn new(animation: &Animation, time: f64) -> Self {
        let pose = animation.pose(time);
        let all = 0..animation.triangle_count() as u32;
        let active = all
            .map(|i| (i, animation.corners(pose, i)))
            .filter(|(_, corners)| is_active(corners));
        let triangles: Vec<_> = active.map(|(i, c)| (i, c.map(wide))).collect();
        let coordinates = triangles.iter().flat_map(|(_, c)| c.iter().flatten());
        let size = coordinates.fold(0.0_f64, |size, x| size.max(x.abs()));
        Self { triangles, size }
    }

    /// Whether single precision can be asked about the ray (see [`TAME`]), and a driver too: none looks behind a ray's origin.
    pub(crate) fn admits(&self, ray: &Ray) -> bool {
        let largest = |p: &Point| p.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        let tame = |x: f32| (TAME[0]..=TAME[1]).contains(&x);
        let size = (self.size as f32).max(largest(&ray.origin));
        ray.is_valid() && ray.t_min >= 0.0 && tame(size) && tame(largest(&ray.direction))
    }

    fn line(&self, ray: &Ray) -> Line {
        let origin = wide(ray.origin);
        let reach = origin.iter().fold(self.size, |m, x| m.max(x.abs()));
        Line {
            origin,
            direction: wide(ray.direction),
            t_min: f64::from(ray.t_min),
            t_max: f64::from(ray.t_max),
            margin: ULPS * ulp(reach),
        }
    }

    /// Why `hit` cannot be the closest of the ray; `None` if it may.
    pub(crate) fn refutes(&self, ray: &Ray, hit: &Hit) -> Option<String> {
        let line = self.line(ray);
        let reported = f64::from(hit.t);
        if hit.is_hit()
            && let Some(why) = self.refutes_hit(&line, hit)
        {
            return Some(why);
        }
        self.triangles.iter().find_map(|(i, corners)| {
            let Verdict::Hit { t, slack } = line.meets(corners) else {
                return None;
            };
            let nearer = !hit.is_hit() || t + slack < reported;
            let text = || format!("triangle {i} is surely hit at {t:?}, give or take {slack:e}");
            (*i != hit.triangle && nearer).then(text)
        })
    }

    /// Likewise, for what is said of the triangle that is said to be hit.
    fn refutes_hit(&self, line: &Line, hit: &Hit) -> Option<String> {
        let found = self.triangles.iter().find(|(i, _)| *i == hit.triangle);
        let Some((i, corners)) = found else {
            return Some(format!("triangle {} is not there", hit.triangle));
        };
        let (t, slack) = match line.meets(corners) {
            Verdict::Missed => return Some(format!("triangle {i} is surely missed")),
            Verdict::Maybe { t, slack } | Verdict::Hit { t, slack } => (t, slack),
        };
        let reported = f64::from(hit.t);
        if (reported - t).abs() > slack + 4.0 * ulp(t) {
            return Some(format!("t should be {t:?}, give or take {slack:e}"));
        }
        let [a, b, c] = *corners;
        let (_, height) = line.inside(corners.map(|p| sub(p, line.origin)));
        let edges = [sub(b, a), sub(c, b), sub(a, c)].map(length);
        let longest = edges.into_iter().fold(0.0, f64::max);
        let allowed = slack * length(line.direction) + line.blur(height) * longest;
        let off = length(sub(line.at(reported), point_at(corners, hit)));
        let is_far = off > allowed + 2.0 * line.margin;
        is_far.then(|| format!("u and v are off by {off:e}, more than {allowed:e}"))
    }

    /// Why a ray cannot be `blocked`, or cannot be free; `None` if it may.
    pub(crate) fn refutes_any(&self, ray: &Ray, blocked: bool) -> Option<String> {
        self.refutes_line(&self.line(ray), blocked, None)
    }

    /// Likewise for the way from a hit to a light, without the triangle that was hit, which leaves the surface as `docs/design/hits.md` says under "Shadow rays".
    ///
    /// The driver is asked of that triangle too. Both ends of the way lie on one side of its plane or in it, so the
    /// way cannot cross it, and the start is off the surface. But where the light lies on the triangle, the way ends there,
    /// at `t = 1` exactly, and rounding may bring that into the open interval.
    pub(crate) fn refutes_shadow(
        &self,
        hit: &Hit,
        light: Point,
        extent: f64,
        blocked: bool,
    ) -> Option<String> {
        if !hit.is_hit() {
            return blocked.then(|| "a miss is in no shadow".to_owned());
        }
        let (_, corners) = self.triangles.iter().find(|(i, _)| *i == hit.triangle)?;
        let (origin, light) = (point_at(corners, hit), wide(light));
        let reach = light.iter().fold(self.size, |m, x| m.max(x.abs()));
        let margin = ULPS * ulp(reach);
        // On a way no longer than rounding nothing is sure.
        if length(sub(light, origin)) <= margin {
            return None;
        }
        if blocked && distance_to_triangle(light, corners) <= margin {
            return None;
        }
        let off_surface = 8.0 * ulp(reach) + 64.0 * ulp(extent);
        let line = Line {
            origin,
            direction: sub(light, origin),
            t_min: 0.0,
            t_max: 1.0,
            margin: margin + off_surface,
        };
        self.refutes_line(&line, blocked, Some(hit.triangle))
    }

    fn refutes_line(&self, line: &Line, blocked: bool, but: Option<u32>) -> Option<String> {
        let mut free = true;
        let asked = |(i, _): &&(u32, _)| Some(*i) != but;
        for (i, corners) in self.triangles.iter().filter(asked) {
            match line.meets(corners) {
                Verdict::Missed => {}
                Verdict::Maybe { .. } => free = false,
                Verdict::Hit { t, .. } if !blocked => {
                    return Some(format!("triangle {i} is surely in the way, at {t:?}"));
                }
                Verdict::Hit { .. } => free = false,
            }
        }
        (free && blocked).then(|| "every triangle is surely missed".to_owned())
    }
}

fn point_at([a, b, c]: &[Vector; 3], hit: &Hit) -> Vector {
    let (u, v) = (f64::from(hit.u), f64::from(hit.v));
    std::array::from_fn(|i| a[i] + (u * (b[i] - a[i]) + v * (c[i] - a[i])))
}

fn ulp(x: f64) -> f64 {
    x.abs() * f64::from(f32::EPSILON / 2.0)
}

#[cfg(test)]
mod tests;
