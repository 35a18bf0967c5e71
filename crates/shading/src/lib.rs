//! Shading of hits: face normals, one colour per triangle, one lamp with shadows, and a soft sky.
//!
//! [`frame_scene`] chooses a camera and a lamp for any motion. [`shade`] converts hits to 8-bit sRGB. Both depend only
//! on their arguments, not on a clock, random numbers or the thread count. The kernel `wgsl/visibility/shade.wgsl`
//! produces the same bytes on a device. Vectors are scaled to a size near 1 by a power of two before they are squared,
//! so that no scene overflows or underflows.

mod light;
mod view;

use geom::{Camera, Hit, Moment, Point};
use glam::Vec3;
use light::{ambient, encode, lamp, linear, sky};
use rayon::prelude::*;

pub use light::palette;
pub use view::{View, frame_scene, query};

/// Scene, camera and lamp of a picture.
#[derive(Clone, Debug)]
pub struct Shot<'a> {
    /// Positions of the triangles.
    pub moment: Moment<'a>,
    /// sRGB colour of each triangle.
    pub colours: &'a [[u8; 3]],
    /// Camera of the picture.
    pub camera: &'a Camera,
    /// Position of the lamp.
    pub light: Point,
}

/// Fills `rgba` with three bytes of sRGB and 255 per pixel, with row 0 at the top. `hits` and `shadow` (1 = lamp
/// occluded) have one entry per pixel, row by row. Runs in the caller's rayon pool. The result does not depend on its
/// thread count.
///
/// # Panics
/// If `hits` or `shadow` do not match the number of pixels, or the colours do not match the number of triangles.
pub fn shade(shot: &Shot<'_>, hits: &[Hit], shadow: &[u8], rgba: &mut Vec<u8>) {
    let width = shot.camera.width.max(1) as usize;
    let pixels = shot.camera.pixels();
    assert!(hits.len() == pixels && shadow.len() == pixels);
    assert_eq!(shot.colours.len(), shot.moment.animation().triangle_count());
    rgba.resize(4 * pixels, 0);
    rgba.par_chunks_mut(4 * width)
        .zip(hits.par_chunks(width).zip(shadow.par_chunks(width)))
        .enumerate()
        .for_each(|(y, (row, (hits, shadow)))| {
            let found = hits.iter().zip(shadow);
            let row = row.as_chunks_mut::<4>().0.iter_mut();
            for (x, (pixel, (hit, &blocked))) in row.zip(found).enumerate() {
                let ray = shot.camera.ray(x as u32, y as u32);
                let direction = unit(ray.direction.into());
                let light = if hit.is_hit() {
                    surface(shot, hit, blocked != 0, direction)
                } else {
                    sky(direction)
                };
                let [r, g, b] = encode(light);
                *pixel = [r, g, b, 255];
            }
        });
}

/// Returns the light that a hit reflects towards the eye. `direction` has length 1.
fn surface(shot: &Shot<'_>, hit: &Hit, blocked: bool, direction: Vec3) -> Vec3 {
    let corners = shot.moment.corners(hit.triangle);
    let exponents = corners.map(exponent_of);
    let own = exponents.into_iter().fold(i32::MIN, i32::max);
    let [a, b, c] = corners.map(|corner| in_units(corner, own));
    let (e1, e2) = (b - a, c - a);
    let mut normal = unit(normalized_exponent(e1).cross(normalized_exponent(e2)));
    if normal.dot(direction) > 0.0 {
        normal = -normal;
    }
    let mut light = ambient(normal);
    if !blocked {
        let along = |e: Vec3, weight: f32| (e * weight).map(|x| cut(x, -100));
        let point = a + (along(e1, hit.u) + along(e2, hit.v));
        // Scales the lamp and the point by the larger exponent.
        let larger = own.max(exponent_of(shot.light));
        let to_lamp = in_units(shot.light, larger) - in_units(point.into(), larger - own);
        light += lamp(normal, unit(to_lamp));
    }
    linear(shot.colours[hit.triangle as usize]) * light
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

/// Returns a point in units of `2^exponent`. Coordinates below `2^-64` become zero.
fn in_units(p: Point, exponent: i32) -> Vec3 {
    let by = f64::from_bits(((1023 - exponent) as u64) << 52);
    p.map(|x| cut((f64::from(x) * by) as f32, -64)).into()
}

/// Replaces values below `2^exponent` by zero.
fn cut(x: f32, exponent: i32) -> f32 {
    let least = f32::from_bits(((127 + exponent) as u32) << 23);
    if x.abs() < least { 0.0 } else { x }
}

/// Scales by the power of two that brings the largest component to `[1, 2)`. Other components below `2^-40` become
/// zero. Returns zero if the largest component is subnormal, at least `2^127`, or not finite.
fn normalized_exponent(v: Vec3) -> Vec3 {
    let sizes = v.to_array().map(|x| x.to_bits() & 0x7fff_ffff);
    let e = sizes.into_iter().max().unwrap_or(0) >> 23;
    if e == 0 || e >= 254 {
        return Vec3::ZERO;
    }
    (v * f32::from_bits((254 - e) << 23)).map(|x| cut(x, -40))
}

/// Normalizes `v` to length 1, with an error of a few units in the last place. Returns zero where
/// [`normalized_exponent`] does. Uses Newton's method with the common initial guess of an inverse square root. Devices
/// repeat these operations bit for bit, but need not round square roots correctly.
fn unit(v: Vec3) -> Vec3 {
    let w = normalized_exponent(v);
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
    use geom::Animation;

    /// Shades a floor of one triangle, seen from above. All lengths scale with `size`, and all pixels hit the triangle.
    fn floor(size: f32) -> Vec<u8> {
        let s = size;
        let corners = vec![[-s, 0.0, -s], [s, 0.0, -s], [0.0, 0.0, s]];
        let animation = Animation::new(vec![corners], vec![[0, 1, 2]]).unwrap();
        let eye = [0.0, s, 0.0];
        let camera = Camera::look_at(eye, [0.0; 3], [0.0, 0.0, 1.0], 5.0, [4, 3]).unwrap();
        let shot = Shot {
            moment: animation.at(0.0).unwrap(),
            colours: &[[200, 100, 50]],
            camera: &camera,
            light: eye,
        };
        let hit = Hit {
            t: s,
            u: 0.25,
            v: 0.5,
            triangle: 0,
        };
        let mut rgba = Vec::new();
        shade(&shot, &[hit; 12], &[0; 12], &mut rgba);
        assert_eq!(rgba.len(), 48);
        rgba
    }

    #[test]
    fn the_scale_of_the_scene_does_not_matter() {
        let want = floor(1.0);
        for size in [1e-36, 1e-12, 1e12, 1e36] {
            assert_eq!(floor(size), want, "{size}");
        }
    }
}
