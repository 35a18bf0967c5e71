//! A pinhole camera whose rays every backend reproduces bit for bit.

use crate::{Point, Ray};

/// Pinhole camera: ray (x, y) has direction `corner + (x + 0.5) * across + (y + 0.5) * down`.
///
/// Row 0 is the top of the image. Directions are not normalised, because devices may round square roots and divisions
/// differently. Devices may treat subnormal numbers as zero. So components of the vectors should be zero or at least
/// `2^-60` in magnitude, as those of [`Camera::look_at`] are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Origin of every ray.
    pub eye: Point,
    /// Width of the image in pixels.
    pub width: u32,
    /// Vector from the eye to the upper left corner of the image.
    pub corner: Point,
    /// Height of the image in pixels.
    pub height: u32,
    /// Vector from one column to the next.
    pub across: Point,
    /// Vector from one row to the next.
    pub down: Point,
}

/// Position, orientation and field of view of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    eye: Point,
    /// Point in the middle of the image.
    target: Point,
    up: Point,
    fov_degrees: f32,
}

impl CameraPose {
    /// Creates the pose of a camera at `eye` whose image has `target` in its middle. The y axis points up, and the
    /// vertical field of view is 40 degrees.
    #[must_use]
    pub fn new(eye: Point, target: Point) -> Self {
        Self {
            eye,
            target,
            up: [0.0, 1.0, 0.0],
            fov_degrees: 40.0,
        }
    }

    /// Sets the up direction.
    #[must_use]
    pub fn with_up(self, up: Point) -> Self {
        Self { up, ..self }
    }

    /// Sets the vertical field of view in degrees.
    #[must_use]
    pub fn with_fov(self, fov_degrees: f32) -> Self {
        Self {
            fov_degrees,
            ..self
        }
    }
}

impl Camera {
    /// Creates a camera for an image of `width` times `height` pixels. Returns `None` in these cases:
    ///
    /// - `eye` equals `target`, or `up` is parallel to the line of sight;
    /// - the field of view is not between 0 and 180 degrees, or the image has no pixels;
    /// - a number is not finite.
    #[must_use]
    pub fn look_at(pose: CameraPose, [width, height]: [u32; 2]) -> Option<Self> {
        let CameraPose {
            eye,
            target,
            up,
            fov_degrees,
        } = pose;
        let [from, to, up] = [eye, target, up].map(|p| p.map(f64::from));
        let forward = unit(std::array::from_fn(|i| to[i] - from[i]))?;
        let side = cross(forward, unit(up)?);
        // The cross product of parallel unit vectors is at most its rounding error.
        if side.iter().all(|x| x.abs() < 4.0 * f64::EPSILON) {
            return None;
        }
        let right = unit(side)?;
        let up = cross(right, forward);
        if !(fov_degrees > 0.0 && fov_degrees < 180.0) || width == 0 || height == 0 {
            return None;
        }
        let half_height = (f64::from(fov_degrees).to_radians() * 0.5).tan();
        let pixel = 2.0 * half_height / f64::from(height);
        let half_width = 0.5 * pixel * f64::from(width);
        let corner = |i: usize| forward[i] - half_width * right[i] + half_height * up[i];
        Some(Self {
            eye,
            width,
            corner: std::array::from_fn(|i| rounded(corner(i))),
            height,
            across: std::array::from_fn(|i| rounded(pixel * right[i])),
            down: std::array::from_fn(|i| rounded(-pixel * up[i])),
        })
    }

    /// Returns the ray through the centre of pixel (x, y).
    ///
    /// The direction is `(corner + (x + 0.5) * across) + (y + 0.5) * down`, with each operation rounded once.
    #[inline]
    pub fn ray(&self, x: u32, y: u32) -> Ray {
        let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
        let direction =
            std::array::from_fn(|i| (self.corner[i] + px * self.across[i]) + py * self.down[i]);
        Ray::new(self.eye, direction)
    }

    /// Returns the rays through all pixels, row by row.
    pub fn rays(&self) -> impl Iterator<Item = Ray> + Clone + '_ {
        let row = move |y| (0..self.width).map(move |x| self.ray(x, y));
        (0..self.height).flat_map(row)
    }

    /// Returns the number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Rounds to `f32`. Magnitudes below `2^-60` become zero, so that no component of a ray's direction is subnormal.
fn rounded(x: f64) -> f32 {
    if x.abs() < (-60_f64).exp2() {
        0.0
    } else {
        x as f32
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length.is_finite() && length > 1e-100).then(|| v.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_rejects_degenerate_views() {
        let ahead = CameraPose::new([0.0; 3], [0.0, 0.0, 1.0]);
        assert!(Camera::look_at(ahead, [8, 8]).is_some());
        for pose in [
            CameraPose::new([1.0; 3], [1.0; 3]),
            CameraPose::new([0.0; 3], [0.0, 1.0, 0.0]),
            ahead.with_up([0.0, 0.0, -2.0]),
            CameraPose::new([0.0; 3], [1.0, 2.0, 5.0]).with_up([3.0, 6.0, 15.0]),
            ahead.with_fov(f32::NAN),
        ] {
            assert!(Camera::look_at(pose, [8, 8]).is_none(), "{pose:?}");
        }
        assert!(Camera::look_at(ahead, [0, 8]).is_none());
    }
}
