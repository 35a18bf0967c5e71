//! How a picture lies before the eye: for kernels that ask what triangles cover of it.

use crate::Params;
use geom::{Camera, Point};

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
        let reach = |i: usize| corner[i].abs() + width * across[i].abs() + height * down[i].abs();
        let largest = (0..3).map(reach).fold(0.0, f64::max);
        let exponent = largest.log2().floor();
        let volume = dot(across, cross(down, corner));
        let rows = [
            cross(down, corner),
            cross(corner, across),
            cross(across, down),
        ];
        let [column, row, depth] = rows.map(|row| row.map(|x| x / volume));
        // A direction is rounded three times, and so is what is made of it.
        let doubt = |axis, pixels| largest * (size(axis) + pixels * size(depth)) * (-22_f64).exp2();
        let margin = doubt(column, width).max(doubt(row, height));
        let scaled = [column, row, depth].map(|row| row.map(|x| (x * exponent.exp2()) as f32));
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

fn wide(p: Point) -> [f64; 3] {
    p.map(f64::from)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn size(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x.abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_tells_no_pixels_apart_has_none() {
        let up = [0.0, 1.0, 0.0];
        let usual = Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], up, 45.0, [64, 48]).unwrap();
        assert!(Projection::of(&usual).is_some());
        for (across, down) in [(0.0, 1.0), (1e-6, 1e-6)] {
            let narrow = Camera {
                across: usual.across.map(|x| x * across),
                down: usual.down.map(|x| x * down),
                ..usual
            };
            assert_eq!(Projection::of(&narrow), None);
        }
    }
}
