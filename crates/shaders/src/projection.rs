//! How a picture lies before the eye: for kernels that ask what triangles cover of it.

use crate::Params;
use geom::{Camera, Point};
use glam::DVec3;

/// Columns and rows are written in 16 bits.
const LONGEST: u32 = 1 << 16;
/// A little more than 0, for rounding in the picture.
const LEAST_MARGIN: f64 = 1.0 / 128.0;

/// The parameters with the picture's projection, if that can be told well enough.
pub(crate) fn projected(mut params: Params, camera: &Camera) -> Option<Params> {
    let p = Projection::of(camera)?;
    (params.column, params.row) = (p.column, p.row);
    (params.depth, params.depth_exponent) = (p.depth, p.exponent);
    params.pixel_margin = p.margin;
    Some(params)
}

/// The inverse of a camera's matrix, `2^exponent` times.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Projection {
    column: [f32; 3],
    row: [f32; 3],
    depth: [f32; 3],
    /// That of the largest component of any ray's direction.
    exponent: i32,
    /// How far from a pixel's middle its ray may pass, in pixels.
    margin: f32,
}

impl Projection {
    fn of(camera: &Camera) -> Option<Self> {
        let [across, down, corner] = [camera.across, camera.down, camera.corner].map(wide);
        let [width, height] = [camera.width, camera.height].map(f64::from);
        let reach = corner.abs() + width * across.abs() + height * down.abs();
        let largest = reach.max_element();
        let exponent = largest.log2().floor();
        let rows = [down.cross(corner), corner.cross(across), across.cross(down)];
        let volume = across.dot(rows[0]);
        let [column, row, depth] = rows.map(|row| row / volume);
        let size = |axis: DVec3| axis.abs().element_sum();
        // A direction is rounded three times, and so is what is made of it.
        let doubt = |axis, pixels| largest * (size(axis) + pixels * size(depth)) * (-22_f64).exp2();
        let margin = doubt(column, width).max(doubt(row, height));
        let scaled = [column, row, depth].map(|row| (row * exponent.exp2()).as_vec3().to_array());
        let is_usual = exponent.abs() < 64.0 && margin < 0.25;
        let is_seen = scaled.as_flattened().iter().all(|x| x.abs() < 1.0e9);
        let is_small = camera.width.max(camera.height) <= LONGEST;
        (is_usual && is_seen && is_small).then_some(Self {
            column: scaled[0],
            row: scaled[1],
            depth: scaled[2],
            exponent: exponent as i32,
            margin: (LEAST_MARGIN + margin) as f32,
        })
    }
}

fn wide(p: Point) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(eye: Point, target: Point, fov: f32) -> Camera {
        Camera::look_at(eye, target, [0.0, 1.0, 0.0], fov, [64, 48]).unwrap()
    }

    #[test]
    fn a_point_on_a_pixels_ray_is_seen_in_its_middle() {
        let scenes = [
            camera([3.0, 1.0, -2.0], [0.0; 3], 45.0),
            camera([1e4, 1e4, 1e4], [1e4, 1e4, 1e4 - 7.0], 100.0),
            camera([0.0, 2.0, 0.0], [0.1, 0.0, 0.0], 3.0),
        ];
        for camera in scenes {
            let p = Projection::of(&camera).expect("a usual camera");
            for (x, y) in [(0, 0), (63, 0), (17, 40), (63, 47)] {
                let d = wide(camera.ray(x, y).direction);
                let [c, r, w] = [p.column, p.row, p.depth].map(|row| wide(row).dot(d));
                let off = |seen: f64, pixel: u32| (seen / w - f64::from(pixel) - 0.5).abs();
                assert!(off(c, x).max(off(r, y)) < f64::from(p.margin));
                // Depth is t, but for a power of two.
                assert!((w / f64::from(p.exponent).exp2() - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn a_camera_that_tells_no_pixels_apart_has_none() {
        let flat = Camera {
            across: [0.0; 3],
            ..camera([0.0; 3], [0.0, 0.0, 1.0], 45.0)
        };
        assert_eq!(Projection::of(&flat), None);
        let narrow = camera([0.0; 3], [0.0, 0.0, 1.0], 45.0);
        let narrow = Camera {
            across: narrow.across.map(|x| x * 1e-6),
            down: narrow.down.map(|x| x * 1e-6),
            ..narrow
        };
        assert_eq!(Projection::of(&narrow), None);
    }
}
