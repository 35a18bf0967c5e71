//! What `t` may be (`docs/design/hits.md`, "What is reported").

use crate::oracle::ExactHit;
use crate::stage;
use crate::stress::scenes::StressScene;
use geom::{Aabb, Moment, Point, Range, Ray};

/// `64 * 2^-24`: more than the padding of boxes and the rounding of their test.
const PADDING: f64 = 64.0 / 16_777_216.0;

/// What decides how far `t` may be off at one moment.
pub(super) struct TBounds<'a> {
    moment: Moment<'a>,
    range: Range,
    /// The box of all active triangles.
    root: Aabb,
}

impl<'a> TBounds<'a> {
    pub(super) fn of(scene: &'a StressScene) -> Self {
        let animation = &*scene.animation;
        let moment = stage::moment(animation, scene.time);
        let all = (0..animation.triangle_count() as u32).map(|t| moment.corners(t));
        let points = all.filter(geom::is_active).flatten();
        let root = points.fold(Aabb::EMPTY, |root, p| root.with_point(p));
        Self {
            range: animation.range(moment.pose()),
            root,
            moment,
        }
    }

    /// Whether `t` may be reported for an exact hit: within the ray's limits, where a float lies there; rounded once
    /// if the ray is extreme, else within the padded box of the triangle.
    pub(super) fn allow(&self, ray: &Ray, hit: &ExactHit, t: f32) -> bool {
        let (least, most) = (ray.t_min.next_up(), ray.t_max.next_down());
        if least <= most && !(least..=most).contains(&t) {
            return false;
        }
        let exponent = -f64::from(self.moment.animation().scale_exponent());
        let scaled: Point = ray.origin.map(|x| (f64::from(x) * exponent.exp2()) as f32);
        if self.range.is_extreme(scaled) {
            let [below, above] = [t.next_down(), t.next_up()].map(f64::from);
            return (below..=above).contains(&hit.t) || t == least || t == most;
        }
        let [near, far] = self.own_span(ray, hit.triangle);
        // Rounded once more from scaled units, where `t` is subnormal.
        let [below, above] = [t.next_down(), t.next_up()].map(f64::from);
        near.min(most.into()) <= above && below <= far.max(least.into())
    }

    /// Where the ray may be said to be within a triangle's box.
    fn own_span(&self, ray: &Ray, triangle: u32) -> [f64; 2] {
        let corners = self.moment.corners(triangle);
        let d = ray.direction.map(f64::from);
        let longest = d.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let axis = d.iter().position(|x| x.abs() == longest).unwrap_or(0);
        let o = f64::from(ray.origin[axis]);
        let depths = corners.map(|p| (f64::from(p[axis]) - o) / d[axis]);
        let reach = (0..3).map(|i| {
            let away = |x: f32| (f64::from(x) - f64::from(ray.origin[i])).abs();
            away(self.root.min[i]).max(away(self.root.max[i]))
        });
        let padding = PADDING * reach.fold(0.0, f64::max) / longest;
        let least = depths.iter().copied().fold(f64::INFINITY, f64::min);
        let most = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        [least - padding, most + padding]
    }
}
