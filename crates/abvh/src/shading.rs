//! Shading of hits on the host: face normals, one colour per triangle, one lamp with shadows, and a soft sky.
//!
//! The result depends only on the arguments, not on a clock, random numbers or the thread count. The kernel
//! `wgsl/visibility/shade.wgsl` produces the same bytes on a device. Vectors are scaled to a size near 1 by a power of
//! two before they are squared, so that no scene overflows or underflows.

mod light;

use crate::frames::LitView;
use crate::mesh::Colour;
use backend::Hits;
use geom::{Hit, Moment, Point, in_parallel};
use glam::Vec3;
pub(crate) use light::palette;
use light::{ambient, encode, lamp, linear, sky};
use rayon::prelude::*;

/// The triangles of a picture.
pub(crate) struct Surfaces<'a> {
    /// Positions.
    pub(crate) moment: Moment<'a>,
    /// sRGB colour of each triangle.
    pub(crate) colours: &'a [Colour],
}

impl Surfaces<'_> {
    /// Fills `rgba` with three bytes of sRGB and 255 per pixel, with row 0 at the top. `hits` are those of the view's
    /// [query](LitView::query).
    ///
    /// # Panics
    /// If the hits do not match the number of pixels, or the colours do not match the number of triangles.
    pub(crate) fn shade(&self, view: LitView<'_>, hits: &Hits, rgba: &mut Vec<u8>) {
        let width = view.camera.width.max(1) as usize;
        let pixels = view.camera.pixels();
        let (closest, shadow) = (&hits.closest, &hits.blocked);
        assert!(closest.len() == pixels && shadow.len() == pixels);
        assert_eq!(self.colours.len(), self.moment.animation().triangle_count());
        rgba.resize(4 * pixels, 0);
        let shade_row = |(y, row): (usize, &mut [u8])| {
            for (x, pixel) in row.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                let ray = view.camera.ray(x as u32, y as u32);
                let direction = unit(ray.direction.into());
                let hit = &closest[y * width + x];
                let light = if hit.is_hit() {
                    let is_lit = shadow[y * width + x] == 0;
                    self.reflected(hit, is_lit.then_some(view.light), direction)
                } else {
                    sky(direction)
                };
                let [r, g, b] = encode(light);
                *pixel = [r, g, b, 255];
            }
        };
        let rows = rgba.par_chunks_mut(4 * width).enumerate();
        in_parallel(|| rows.for_each(shade_row));
    }

    /// Returns the light that a hit reflects towards the eye. `lamp_at` is the position of the lamp, unless it is
    /// occluded. `direction` has length 1.
    fn reflected(&self, hit: &Hit, lamp_at: Option<Point>, direction: Vec3) -> Vec3 {
        let corners = self.moment.corners(hit.triangle);
        let exponents = corners.map(exponent_of);
        let own = exponents.into_iter().fold(i32::MIN, i32::max);
        let [a, b, c] = corners.map(|corner| in_units(corner, own));
        let (e1, e2) = (b - a, c - a);
        let mut normal = unit(scaled_near_one(e1).cross(scaled_near_one(e2)));
        if normal.dot(direction) > 0.0 {
            normal = -normal;
        }
        let mut light = ambient(normal);
        if let Some(lamp_at) = lamp_at {
            let along = |e: Vec3, weight: f32| (e * weight).map(|x| cut(x, -100));
            let point = a + (along(e1, hit.u) + along(e2, hit.v));
            // Scales the lamp and the point by the larger exponent.
            let larger = own.max(exponent_of(lamp_at));
            let to_lamp = in_units(lamp_at, larger) - in_units(point.into(), larger - own);
            light += lamp(normal, unit(to_lamp));
        }
        linear(self.colours[hit.triangle as usize]) * light
    }
}

/// Returns `floor(log2)` of the largest absolute coordinate, or -150 if all are zero.
fn exponent_of(p: Point) -> i32 {
    let sizes = p.map(|x| x.to_bits() & 0x7fff_ffff);
    let most = sizes.into_iter().max().unwrap_or(0);
    match most >> 23 {
        0 => 31 - most.leading_zeros() as i32 - 149,
        e => e as i32 - 127,
    }
}

/// Returns a point in units of `2^exponent`. Coordinates of magnitude below `2^-64` become zero.
fn in_units(p: Point, exponent: i32) -> Vec3 {
    let by = f64::from_bits(((1023 - exponent) as u64) << 52);
    p.map(|x| cut((f64::from(x) * by) as f32, -64)).into()
}

/// Replaces values of magnitude below `2^exponent` by zero.
fn cut(x: f32, exponent: i32) -> f32 {
    let least = f32::from_bits(((127 + exponent) as u32) << 23);
    if x.abs() < least { 0.0 } else { x }
}

/// Scales by the power of two that brings the magnitude of the largest component to `[1, 2)`. Other components of
/// magnitude below `2^-40` become zero. Returns zero if the largest component is subnormal, at least `2^127`, or not
/// finite.
fn scaled_near_one(v: Vec3) -> Vec3 {
    let sizes = v.to_array().map(|x| x.to_bits() & 0x7fff_ffff);
    let e = sizes.into_iter().max().unwrap_or(0) >> 23;
    if e == 0 || e >= 254 {
        return Vec3::ZERO;
    }
    (v * f32::from_bits((254 - e) << 23)).map(|x| cut(x, -40))
}

/// Normalizes `v` to length 1, with an error of a few units in the last place. Returns zero where
/// [`scaled_near_one`] does. Uses Newton's method with the common initial guess of an inverse square root, because
/// devices need not round square roots correctly. They reproduce the operations used here bit for bit.
fn unit(v: Vec3) -> Vec3 {
    let w = scaled_near_one(v);
    let square = w.dot(w);
    if square == 0.0 {
        return w;
    }
    let half_square = 0.5 * square;
    let mut y = f32::from_bits(0x5f37_5a86 - (square.to_bits() >> 1));
    for _ in 0..3 {
        y *= 1.5 - half_square * (y * y);
    }
    w * y
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::{Animation, Camera, CameraPose};

    /// Shades a floor of one triangle, seen from above. All lengths scale with `size`, and all pixels hit the triangle.
    fn floor(size: f32) -> Vec<u8> {
        let s = size;
        let corners = vec![[-s, 0.0, -s], [s, 0.0, -s], [0.0, 0.0, s]];
        let animation = Animation::new(vec![corners], vec![[0, 1, 2]]).unwrap();
        let eye = [0.0, s, 0.0];
        let pose = CameraPose::new(eye, [0.0; 3]).with_fov(5.0);
        let camera = Camera::look_at(pose.with_up([0.0, 0.0, 1.0]), [4, 3]).unwrap();
        let surfaces = Surfaces {
            moment: animation.at(0.0).unwrap(),
            colours: &[[200, 100, 50]],
        };
        let view = LitView {
            camera: &camera,
            light: eye,
        };
        let hit = Hit {
            t: s,
            u: 0.25,
            v: 0.5,
            triangle: 0,
        };
        let hits = Hits {
            closest: vec![hit; 12],
            blocked: vec![0; 12],
        };
        let mut rgba = Vec::new();
        surfaces.shade(view, &hits, &mut rgba);
        assert_eq!(rgba.len(), 48);
        rgba
    }

    #[test]
    fn shading_is_independent_of_scale() {
        let want = floor(1.0);
        for size in [1e-36, 1e-12, 1e12, 1e36] {
            assert_eq!(floor(size), want, "{size}");
        }
    }
}
