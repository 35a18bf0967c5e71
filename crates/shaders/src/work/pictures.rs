//! Pictures for which the order matters in which rays and triangles are brought together: by packets, by rasterization.

use super::{Groups, Trace, Work};
use crate::pictures::{packets_pay, rasterization_pays};
use crate::projection::projected;
use crate::{Params, Traits, common, kernel};
use backend::Method;
use geom::{Camera, Point};

/// Rows of the buffer `covers` before the tiles: see visibility/cover.wgsl.
const LISTED: u32 = 4096;
/// Workgroups that share the large triangles: eight a multiprocessor of an H200, of which some wait while others compute.
const SHARERS: u32 = 1056;

/// A camera's closest hits and their shadows packet by packet, where that pays.
pub(super) fn by_packets(
    method: Method,
    params: Params,
    camera: &Camera,
    traits: Traits,
) -> Option<Trace> {
    let how = traits.packets?;
    let seen = params.through(camera);
    if !packets_pay(method, &seen, how) {
        return None;
    }
    let params = projected(seen, camera)?;
    let triangles = params.node_count.div_ceil(2);
    let trace = over_blocks(how.kernel(), method, params, how.block());
    let things = params.wide_lanes + triangles;
    let project = Work::linear(kernel("project", method), params, things);
    Some(Trace {
        primary: vec![project, trace],
        // A row of 16 bytes for each lane, two for each triangle.
        cover_bytes: 16 * u64::from(things + triangles),
        ..Trace::default()
    })
}

/// A camera's closest hits triangle by triangle, and then their shadows, where that pays.
pub(super) fn by_rasterization(
    method: Method,
    params: Params,
    camera: &Camera,
    traits: Traits,
) -> Option<Trace> {
    let how = traits.packets.filter(|_| traits.rasterizes)?;
    let seen = params.through(camera);
    if !rasterization_pays(method, &seen, how) {
        return None;
    }
    let pixels = camera.width * camera.height;
    let triangles = params.node_count.div_ceil(2);
    let tiles = triangles + pixels / 4;
    let mut params = projected(seen, camera)?;
    params.notes = tiles;
    // One more, for whether rasterization has told all.
    let pairs = pixels / 2 + 1;
    let none = Params { count: 0, ..params };
    let each = |kernel, groups| Work::new(kernel, none, Groups::Each(groups));
    let rasterize = kernel(how.rasterizer(), method);
    let rasterizers = tiles.div_ceil(rasterize.workgroup[0]);
    let rasterizers = rasterizers.min(how.rasterizers());
    Some(Trace {
        primary: vec![
            Work::linear(common("clear_visibility"), params, pairs),
            Work {
                alongside: true,
                ..Work::linear(kernel("cover_small", method), params, triangles)
            },
            each(kernel("cover_large", method), SHARERS),
            each(rasterize, rasterizers),
            over_blocks("resolve", method, params, [16, 8]),
        ],
        cover_bytes: 16 * u64::from(LISTED + tiles),
        visibility_bytes: 16 * u64::from(pairs),
        ..Trace::default()
    })
}

/// A camera's hits and shadows to pixels, under a lamp.
#[must_use]
pub fn shade(params: Params, camera: &Camera, lamp: Point) -> Work {
    let kernel = common("shade");
    let [width, height, _] = kernel.workgroup;
    let params = Params {
        // In the scene's units.
        light: lamp,
        ..params.through(camera)
    };
    let groups = Groups::Pixels([camera.width, camera.height], [width, height]);
    Work::new(kernel, params, groups)
}

/// Over a picture, so many pixels a workgroup.
fn over_blocks(entry: &str, method: Method, params: Params, block: [u32; 2]) -> Work {
    let groups = Groups::Pixels([params.width, params.height], block);
    Work::new(kernel(entry, method), params, groups)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_keep_stamps_where_the_host_makes_room() {
        let wgsl = include_str!("../../wgsl/visibility/cover.wgsl");
        assert!(wgsl.contains(&format!("const LISTED: u32 = {LISTED}u;")));
    }
}
