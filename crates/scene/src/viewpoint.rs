//! Automatic camera and light for any motion.

use geom::{Aabb, Animation, Camera, CameraPose, Point};
use glam::{DVec2, DVec3, dvec2, dvec3};
use rayon::prelude::*;

/// Direction from the scene to the eye, which is in front, to the right and slightly above.
const TO_EYE: DVec3 = dvec3(0.50, 0.38, 0.78);
const UP: DVec3 = DVec3::Y;
/// Fraction of the picture that the scene fills along one axis. Along the other axis, it fills less.
const FILL: f64 = 0.94;

/// Parameters of a camera, and the position of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position of the eye.
    pub eye: Point,
    /// Point at the centre of the picture.
    pub look_at: Point,
    /// Up direction.
    pub up: Point,
    /// Vertical field of view in degrees.
    pub fov_degrees: f32,
    /// Position of the light.
    pub light: Point,
}

impl Viewpoint {
    /// Chooses a view from the front, the right and slightly above that shows every finite vertex of every key frame.
    /// For paged animations, the view is fitted to the bounding boxes of the key frames instead.
    ///
    /// The light is above and to the left, outside the bounds. Flat, single-point and empty animations also get a view.
    #[must_use]
    pub fn framing(animation: &Animation, fov_degrees: f32, [width, height]: [u32; 2]) -> Self {
        let bounds = animation.bounds();
        let centre = centre(&bounds);
        let size = size(&bounds);
        let tan_y = (f64::from(fov_degrees).to_radians() * 0.5).tan() * FILL;
        let tan_x = tan_y * f64::from(width.max(1)) / f64::from(height.max(1));
        let tan = dvec2(tan_x, tan_y);
        let unit = |v: DVec3| v / v.length();
        let back = unit(TO_EYE);
        let right = unit(UP.cross(back));
        let up = back.cross(right);
        let extent = PyramidExtent::of(animation, centre, [right, up, back], tan);
        // Without finite vertices, the size is 1 and any view will do.
        let shift = extent.map_or(DVec2::ZERO, |extent| extent.shift());
        let middle = centre + (right * shift.x + up * shift.y);
        let distance = extent.map_or(2.0 * size, |extent| extent.distance(tan, size));
        let to_light = right * -0.62 + (UP * 0.95 + back * 0.80);
        Self {
            eye: narrow(middle + back * distance),
            look_at: narrow(middle),
            up: narrow(UP),
            fov_degrees,
            light: narrow(centre + unit(to_light) * (1.15 * size)),
        }
    }

    /// Returns the camera for a picture of `size` (width, height), or `None` if [`Camera::look_at`] returns `None`.
    #[must_use]
    pub fn camera(&self, size: [u32; 2]) -> Option<Camera> {
        let pose = CameraPose::new(self.eye, self.look_at).with_up(self.up);
        Camera::look_at(pose.with_fov(self.fov_degrees), size)
    }
}

/// Extent of the vertices relative to the four sides of a view pyramid. Coordinates are along the camera's axes, with
/// `z` towards the eye.
#[derive(Clone, Copy)]
struct PyramidExtent {
    /// Maximum of `x + z * tan` along each axis of the picture.
    high: DVec2,
    /// Maximum of `-x + z * tan` along each axis of the picture.
    low: DVec2,
    /// Largest `z`.
    near: f64,
}

impl PyramidExtent {
    /// Computes the extent for the camera's axes: right, up and back. Returns `None` if no vertex is finite.
    fn of(animation: &Animation, centre: DVec3, axes: [DVec3; 3], tan: DVec2) -> Option<Self> {
        let of_point = |p: &Point| {
            let p = wide(*p) - centre;
            let [x, y, z] = axes.map(|axis| p.dot(axis));
            Self {
                high: z * tan + dvec2(x, y),
                low: z * tan - dvec2(x, y),
                near: z,
            }
        };
        let of_points = |points: &[Point]| {
            let finite = points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
            finite.map(of_point).reduce(Self::max)
        };
        // `None` for a paged animation.
        let Some(keys) = animation.held_keys() else {
            let boxes = animation.key_bounds().iter().filter(|b| !b.is_empty());
            let extents = boxes.filter_map(|b| of_points(&b.corners()));
            return extents.reduce(Self::max);
        };
        let runs = keys.par_iter().flat_map(|key| key.par_chunks(1 << 14));
        runs.filter_map(of_points).reduce_with(Self::max)
    }

    fn max(self, other: Self) -> Self {
        Self {
            high: self.high.max(other.high),
            low: self.low.max(other.low),
            near: self.near.max(other.near),
        }
    }

    /// Returns the eye's shift along both axes of the picture.
    fn shift(&self) -> DVec2 {
        (self.high - self.low) / 2.0
    }

    /// Returns the eye's distance back from the centre. All vertices are at least `0.05 * size` in front of the eye.
    fn distance(&self, tan: DVec2, size: f64) -> f64 {
        // A vertex is inside the pyramid if |x - shift| <= (back - z) * tan along both axes of the picture.
        let back = (self.high + self.low) / (2.0 * tan);
        back.max_element().max(self.near + 0.05 * size)
    }
}

fn centre(bounds: &Aabb) -> DVec3 {
    if bounds.is_empty() {
        DVec3::ZERO
    } else {
        wide(bounds.min).midpoint(wide(bounds.max))
    }
}

/// Returns the length of the bounds' diagonal, but at least 1e-4 of the centre's largest coordinate. A shorter
/// length would be lost in the rounding of the coordinates. Returns 1 if both are 0, as for empty bounds. Any other
/// result is at least 1e-36.
fn size(bounds: &Aabb) -> f64 {
    let least = 1e-4 * centre(bounds).abs().max_element();
    match bounds.diagonal().max(least) {
        0.0 => 1.0,
        size => size.max(1e-36),
    }
}

/// Rounds to f32. Clamps to half the largest finite value, so that differences stay finite.
fn narrow(p: DVec3) -> Point {
    let limit = f64::from(f32::MAX) * 0.5;
    p.to_array().map(|x| x.clamp(-limit, limit) as f32)
}

fn wide(p: Point) -> DVec3 {
    p.map(f64::from).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [160, 90];

    fn animation(keys: Vec<Vec<Point>>) -> Animation {
        let n = keys[0].len() as u32;
        let triangles = if n < 3 { vec![] } else { vec![[0, 1, n - 1]] };
        Animation::new(keys, triangles).unwrap()
    }

    /// Returns the position of a point in the picture, from 0 to 1 across and down, and its depth.
    fn project(camera: &Camera, p: Point) -> [f64; 3] {
        let [c, a, d] = [camera.corner, camera.across, camera.down].map(wide);
        let v = wide(p) - wide(camera.eye);
        let det = c.dot(a.cross(d));
        let depth = v.dot(a.cross(d)) / det;
        let x = c.dot(v.cross(d)) / det / depth;
        let y = c.dot(a.cross(v)) / det / depth;
        let [width, height] = [camera.width, camera.height].map(f64::from);
        [x / width, y / height, depth]
    }

    fn cloud(centre: Point, size: Point) -> Vec<Point> {
        let at = |i: u32| -> Point {
            std::array::from_fn(|a| {
                let r = (i.wrapping_mul(2_654_435_761).rotate_left(11 * a as u32) % 1000) as f32;
                centre[a] + size[a] * (r / 999.0 - 0.5)
            })
        };
        (0..50).map(at).collect()
    }

    #[test]
    fn camera_frames_the_whole_motion() {
        let [long, tall, flat] = [[9.0, 0.1, 0.1], [0.1, 9.0, 0.1], [4.0, 0.0, 4.0]];
        let shapes = [[1.0; 3], long, tall, flat];
        for size in [SIZE, [90, 160], [64, 64]] {
            for (shape, fov) in shapes.iter().flat_map(|s| [(s, 20.0), (s, 60.0)]) {
                let keys = [3.0, 4.0].map(|x| cloud([x, 4.0, 5.0], *shape));
                let a = animation(keys.to_vec());
                let camera = Viewpoint::framing(&a, fov, size).camera(size).unwrap();
                let keys = a.all_keys().unwrap();
                let all = keys.iter().flat_map(|key| key.iter());
                let seen: Vec<_> = all.map(|&p| project(&camera, p)).collect();
                assert!(seen.iter().all(|s| s[2] > 0.0));
                let all = |i: usize| {
                    let min = seen.iter().map(|s| s[i]).fold(f64::INFINITY, f64::min);
                    let max = seen.iter().map(|s| s[i]).fold(f64::NEG_INFINITY, f64::max);
                    (min, max)
                };
                let ((x0, x1), (y0, y1)) = (all(0), all(1));
                let is_within = x0 >= 0.0 && x1 <= 1.0 && y0 >= 0.0 && y1 <= 1.0;
                let fills = x1 - x0 > 0.8 || y1 - y0 > 0.8;
                assert!(is_within && fills, "{shape:?} {fov} {x0} {x1} {y0} {y1}");
            }
        }
    }

    #[test]
    fn degenerate_scenes_get_a_camera() {
        let nan = [f32::NAN, 0.0, 0.0];
        let odd = [
            vec![],
            vec![nan; 3],
            vec![[0.0; 3]; 3],
            vec![[1e9, -1e9, 3.0]; 3],
            vec![[1e-45; 3], [0.0; 3], [-1e-45; 3]],
            vec![[1e-45, 0.0, 0.0], [0.0; 3], [0.0; 3]],
            vec![[1e6, 1e6, 1e6], [1e6 + 0.0625, 1e6, 1e6], nan],
            vec![[3e38; 3], [-3e38; 3], [0.0; 3]],
        ];
        for points in odd {
            let view = Viewpoint::framing(&animation(vec![points.clone()]), 40.0, SIZE);
            let camera = view.camera(SIZE);
            assert!(camera.is_some(), "{points:?}: {view:?}");
            assert!(view.light.iter().all(|x| x.is_finite()));
        }
        let ones = [[0.0; 3], [1.0; 3], [1.0, 0.0, 0.0]];
        let mut more = ones.to_vec();
        more.insert(1, [f32::INFINITY, 0.0, 0.0]);
        let views =
            [ones.to_vec(), more].map(|p| Viewpoint::framing(&animation(vec![p]), 40.0, SIZE));
        assert_eq!(
            views[0], views[1],
            "a vertex that is not finite does not count"
        );
    }
}
