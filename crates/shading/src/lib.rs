//! Hits in, pixels out: face normals, one colour a triangle, one lamp with shadows, a soft sky.
//!
//! [`frame_scene`] finds a camera and a light for a motion that nobody described, and [`shade`] turns what a trace found
//! into 8-bit sRGB. Both are functions of their arguments alone: no clock, no chance, no thread count. The kernel
//! `wgsl/visibility/shade.wgsl` gives the same bytes on a device. What is squared is first brought to a size near 1 by a
//! power of two, so that no scene overflows or vanishes.

mod light;
mod view;

use geom::{Camera, Hit, Moment, Point};
use glam::Vec3;
use light::{ambient, encode, lamp, linear, sky};
use rayon::prelude::*;

pub use light::palette;
pub use view::{View, frame_scene, query};

/// What a picture shows, beside the hits.
#[derive(Clone, Debug)]
pub struct Shot<'a> {
    /// The triangles.
    pub moment: Moment<'a>,
    /// sRGB, one a triangle.
    pub colours: &'a [[u8; 3]],
    /// Who looks.
    pub camera: &'a Camera,
    /// Where the lamp is.
    pub light: Point,
}

/// Fills `rgba` with three bytes of sRGB and 255 a pixel, row 0 at the top. `hits` and `shadow` (1 = the way to the lamp is
/// blocked) hold one entry a pixel, row by row. Runs in the caller's rayon pool; the bytes do not depend on it.
///
/// # Panics
/// If `hits`, `shadow` or the colours are fewer than the pixels or the triangles.
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

/// Light that leaves a hit towards the eye; `direction` has length 1.
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
        // Lamp and point in units of the larger.
        let larger = own.max(exponent_of(shot.light));
        let to_lamp = in_units(shot.light, larger) - in_units(point.into(), larger - own);
        light += lamp(normal, unit(to_lamp));
    }
    linear(shot.colours[hit.triangle as usize]) * light
}

/// `floor(log2)` of the largest coordinate; -150 of zero.
fn exponent_of(p: Point) -> i32 {
    let sizes = p.map(|x| x.to_bits() & 0x7fff_ffff);
    let most = sizes.into_iter().max().unwrap_or(0);
    match most >> 23 {
        0 => 31 - most.leading_zeros() as i32 - 149,
        e => e as i32 - 127,
    }
}

/// A point in units of `2^exponent`; below `2^-64` a coordinate is zero.
fn in_units(p: Point, exponent: i32) -> Vec3 {
    let by = f64::from_bits(((1023 - exponent) as u64) << 52);
    p.map(|x| cut((f64::from(x) * by) as f32, -64)).into()
}

/// Zero in place of what is below `2^exponent`.
fn cut(x: f32, exponent: i32) -> f32 {
    let least = f32::from_bits(((127 + exponent) as u32) << 23);
    if x.abs() < least { 0.0 } else { x }
}

/// By the power of two that brings the largest component to `[1, 2)`, the others cut to zero below `2^-40`. Zero where the
/// largest is subnormal, `2^127` or more, or no number.
fn normalized_exponent(v: Vec3) -> Vec3 {
    let sizes = v.to_array().map(|x| x.to_bits() & 0x7fff_ffff);
    let e = sizes.into_iter().max().unwrap_or(0) >> 23;
    if e == 0 || e >= 254 {
        return Vec3::ZERO;
    }
    (v * f32::from_bits((254 - e) << 23)).map(|x| cut(x, -40))
}

/// `v` at length 1, but for a few units in the last place; zero where [`normalized_exponent`] is. By Newton's method from
/// the customary guess at an inverse root: devices repeat its operations bit for bit, but need not round roots correctly.
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

    /// A floor of one huge triangle, seen from above at `scale`; all pixels hit it.
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
