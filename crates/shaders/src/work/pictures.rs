//! Dispatches that trace pictures by packets or by rasterization, and that shade pictures. Kernels that project
//! triangles to the picture have the inverse of the camera's matrix as parameters.

use super::{Groups, Trace, Work};
use crate::pictures::{are_packets_faster, is_rasterization_faster};
use crate::{Params, RasterParams, Traits, common, kernel};
use backend::Intersector;
use geom::{Camera, Point};
use glam::DVec3;

/// Number of rows of the buffer `pixel_coverage` before the tiles: see visibility/cover.wgsl.
const LARGE_CAPACITY: u32 = 4096;
/// Number of workgroups that share the large triangles: eight per multiprocessor of an H200, so that some compute while
/// others wait.
const SHARERS: u32 = 1056;

/// Returns the trace of a camera's closest hits and shadow rays by packets. Returns `None` if packets are impossible,
/// or [`are_packets_faster`] returns false.
pub(super) fn by_packets(
    intersector: Intersector,
    params: Params,
    camera: &Camera,
    traits: Traits,
) -> Option<Trace> {
    let how = traits.packets?;
    let seen = params.with_camera(camera);
    if !are_packets_faster(&seen, how) {
        return None;
    }
    let params = projected(seen, camera)?;
    let triangles = params.node_count.div_ceil(2);
    let (tracer, block) = how.tracer();
    let trace = over_blocks(tracer, intersector, params, block);
    let projected_count = params.wide_lanes + triangles;
    let project = Work::linear(kernel("project", intersector), params, projected_count);
    Some(Trace {
        primary: vec![project, trace],
        // One row of 16 bytes per child of a wide node, and two per triangle.
        coverage_bytes: 16 * u64::from(projected_count + triangles),
        ..Trace::default()
    })
}

/// Returns the trace of a camera's closest hits by rasterization and of their shadow rays. Returns `None` if
/// rasterization is impossible, or [`is_rasterization_faster`] returns false.
pub(super) fn by_rasterization(
    intersector: Intersector,
    params: Params,
    camera: &Camera,
    traits: Traits,
) -> Option<Trace> {
    let how = traits.packets.filter(|_| traits.rasterizes)?;
    let seen = params.with_camera(camera);
    if !is_rasterization_faster(&seen, how) {
        return None;
    }
    let pixels = camera.width * camera.height;
    let triangles = params.node_count.div_ceil(2);
    let tiles = triangles + pixels / 4;
    let params = projected(seen, camera)?.with(RasterParams {
        tile_capacity: tiles,
    });
    let keys_per_pixel = match intersector {
        Intersector::Watertight => 1,
        _ => 2,
    };
    // The visibility buffer has 64-bit elements: the keys of all pixels, then one that says whether rasterization was
    // complete. A row of 16 bytes holds two.
    let rows = keys_per_pixel * pixels / 2 + 1;
    let no_count = Params { count: 0, ..params };
    let each = |kernel, groups| Work::new(kernel, no_count, Groups::Each(groups));
    let (rasterize, most) = how.rasterizers();
    let rasterize = kernel(rasterize, intersector);
    let rasterizers = tiles.div_ceil(rasterize.workgroup[0]).min(most);
    Some(Trace {
        primary: vec![
            Work::linear(common("clear_visibility"), params, rows),
            Work {
                alongside: true,
                ..Work::linear(kernel("cover_small", intersector), params, triangles)
            },
            each(kernel("cover_large", intersector), SHARERS),
            each(rasterize, rasterizers),
            over_blocks("resolve", intersector, seen, [16, 8]),
        ],
        coverage_bytes: 16 * u64::from(LARGE_CAPACITY + tiles),
        visibility_bytes: 16 * u64::from(rows),
        ..Trace::default()
    })
}

/// Returns the dispatch that shades a camera's hits under a lamp.
#[must_use]
pub fn shade(params: Params, camera: &Camera, lamp: Point) -> Work {
    let [width, height, _] = common("shade").workgroup;
    let params = Params {
        // In scene units.
        light: lamp,
        ..params.with_camera(camera)
    };
    over_blocks("shade", Intersector::Watertight, params, [width, height])
}

/// Returns a dispatch over a picture, one workgroup per `block` of pixels.
fn over_blocks(entry: &str, intersector: Intersector, params: Params, block: [u32; 2]) -> Work {
    let groups = Groups::Pixels([params.width, params.height], block);
    Work::new(kernel(entry, intersector), params, groups)
}

/// Maximum width and height of a picture for which triangles are projected, in pixels. Kernels store columns and rows
/// in 16 bits.
const MAX_PICTURE_SIDE: u32 = 1 << 16;
/// Constant part of [`Params::pixel_margin`], in pixels. It covers the rounding of pixel coordinates when kernels
/// project: see `docs/design/packets.md`.
const LEAST_MARGIN: f64 = 1.0 / 128.0;

/// Returns the parameters with the inverse of a camera's matrix, times `2^depth_exponent`. The exponent is that of an
/// upper bound on all components of the rays' directions. Returns `None` if the picture, an element of the inverse,
/// the exponent's magnitude, or a rounding error is too large.
fn projected(params: Params, camera: &Camera) -> Option<Params> {
    let [across, down, corner] = [camera.across, camera.down, camera.corner].map(to_f64);
    let [width, height] = [camera.width, camera.height].map(f64::from);
    let reach = corner.abs() + width * across.abs() + height * down.abs();
    let largest = reach.max_element();
    let exponent = largest.log2().floor();
    let rows = [down.cross(corner), corner.cross(across), across.cross(down)];
    let volume = across.dot(rows[0]);
    let [column, row, depth] = rows.map(|row| row / volume);
    let size = |axis: DVec3| axis.abs().element_sum();
    // A direction is rounded three times, and so are the values computed from it.
    let error = |axis, pixels| largest * (size(axis) + pixels * size(depth)) * (-22_f64).exp2();
    let margin = error(column, width).max(error(row, height));
    let scaled = [column, row, depth].map(|row| (row * exponent.exp2()).as_vec3().to_array());
    // Bound on the error of a hit's depth that rounded directions cause, in units of 2^-24 of the largest depth: see
    // "Depths" in docs/design/packets.md.
    let depth_error = 3.0 * largest * size(depth);
    let is_usual = exponent.abs() < 64.0 && margin < 0.25 && depth_error <= 31.0;
    let is_bounded = scaled.as_flattened().iter().all(|x| x.abs() < 1.0e9);
    let is_small = camera.width.max(camera.height) <= MAX_PICTURE_SIDE;
    let [column, row, depth] = scaled;
    (is_usual && is_bounded && is_small).then_some(Params {
        column,
        row,
        depth,
        depth_exponent: exponent as i32,
        pixel_margin: (LEAST_MARGIN + margin) as f32,
        ..params
    })
}

fn to_f64(p: Point) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geom::CameraPose;

    #[test]
    fn list_length_matches_kernel_source() {
        let kernel = kernel("cover_small", Intersector::Watertight);
        kernel.assert_declares("LARGE_CAPACITY", LARGE_CAPACITY);
    }

    fn camera(eye: Point, target: Point, fov: f32) -> Camera {
        Camera::look_at(CameraPose::new(eye, target).with_fov(fov), [64, 48]).unwrap()
    }

    #[test]
    fn projection_maps_rays_to_pixel_centers() {
        let scenes = [
            camera([3.0, 1.0, -2.0], [0.0; 3], 45.0),
            camera([1e4, 1e4, 1e4], [1e4, 1e4, 1e4 - 7.0], 100.0),
            camera([0.0, 2.0, 0.0], [0.1, 0.0, 0.0], 3.0),
        ];
        for camera in scenes {
            let p = projected(Params::default(), &camera).expect("a usual camera");
            for (x, y) in [(0, 0), (63, 0), (17, 40), (63, 47)] {
                let d = to_f64(camera.ray(x, y).direction);
                let [c, r, w] = [p.column, p.row, p.depth].map(|row| to_f64(row).dot(d));
                let off = |seen: f64, pixel: u32| (seen / w - f64::from(pixel) - 0.5).abs();
                assert!(off(c, x).max(off(r, y)) < f64::from(p.pixel_margin));
                // Depth is t times a power of two.
                assert!((w / f64::from(p.depth_exponent).exp2() - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn degenerate_camera_has_no_projection() {
        let flat = Camera {
            across: [0.0; 3],
            ..camera([0.0; 3], [0.0, 0.0, 1.0], 45.0)
        };
        assert_eq!(projected(Params::default(), &flat), None);
        let narrow = camera([0.0; 3], [0.0, 0.0, 1.0], 45.0);
        let narrow = Camera {
            across: narrow.across.map(|x| x * 1e-6),
            down: narrow.down.map(|x| x * 1e-6),
            ..narrow
        };
        assert_eq!(projected(Params::default(), &narrow), None);
    }
}
