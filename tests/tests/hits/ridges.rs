//! Pictures of ridges, with rays along every crest: both slopes are candidates for the hit, the lower index is it, and
//! the one slope lies in shadow there and the other in the light. So few hits are open that a device seeks the
//! shadows of their candidates before it knows which of them it is.

use crate::exact::Device;
use crate::hard::same;
use backend::{Backend, Hits, Intersector, Layout, Method, QueryKind, Rays};
use geom::{Animation, Camera, Point};
use integration::stage::Stage;
use libtest_mimic::Failed;
use std::sync::Arc;

/// Ridges, and stretches of each.
const RIDGES: i16 = 16;
const STRETCHES: i16 = 40;
/// Rows of pixels, none of which meets the end of a stretch.
const ROWS: u32 = 12;

pub(crate) fn test(device: Device) -> Result<(), Failed> {
    let animation = ridges()?;
    let mut layouts = Layout::ALL.into_iter();
    layouts.try_for_each(|l| along_crests(device, &animation, l))
}

/// Steep on the left, gentle on the right; of every other ridge the left slope comes first.
fn ridges() -> Result<Arc<Animation>, Failed> {
    let (mut points, mut triangles) = (Vec::<Point>::new(), Vec::new());
    for ridge in 0..RIDGES {
        let crest = f32::from(2 * (ridge - RIDGES / 2));
        for stretch in 0..STRETCHES {
            let y = f32::from(stretch - STRETCHES / 2);
            let at = points.len() as u32;
            for (x, z) in [(crest - 0.25, -1.0), (crest, 0.0), (crest + 1.75, -1.0)] {
                points.extend([[x, y, z], [x, y + 1.0, z]]);
            }
            let slope = |v: u32| [[v, v + 2, v + 1], [v + 2, v + 3, v + 1]];
            let (left, right) = (slope(at), slope(at + 2));
            let both = if ridge % 2 == 0 {
                [left, right]
            } else {
                [right, left]
            };
            triangles.extend(both.concat());
        }
    }
    // In a plane with the eye and the first column of pixels, whose rays so miss it.
    let at = points.len() as u32;
    points.extend([[-18.0, -8.0, 0.0], [-18.0, 8.0, 0.0], [-9.0, 0.0, 8.0]]);
    triangles.push([at, at + 1, at + 2]);
    let still = Animation::new(vec![points.clone(), points], triangles);
    Ok(Arc::new(still.map_err(|e| e.to_string())?))
}

/// One column of pixels for each crest and one between, seen from above, and two beside the ridges.
fn camera() -> Camera {
    Camera {
        eye: [0.0, 0.0, 16.0],
        width: 2 * RIDGES as u32 + 2,
        corner: [f32::from(-RIDGES) - 2.5, ROWS as f32 / 2.0 + 0.75, -16.0],
        height: ROWS,
        across: [1.0, 0.0, 0.0],
        pad0: 0,
        down: [0.0, -1.0, 0.0],
        pad1: 0,
    }
}

fn along_crests(device: Device, animation: &Arc<Animation>, layout: Layout) -> Result<(), Failed> {
    let host = Box::new(cpu_ref::CpuBackend::new(Some(2))?);
    let expected = ask(host, animation, layout)?;
    let on_crests = |dark: u8| {
        let all = expected.closest.iter().zip(&expected.blocked).step_by(2);
        all.filter(|&(hit, &b)| hit.is_hit() && b == dark).count()
    };
    let [lit, dark] = [on_crests(0), on_crests(1)];
    if lit < 60 || dark < 60 {
        return Err(format!("{lit} crests lit, {dark} dark: too few to tell").into());
    }
    same(&expected, &ask(device.open()?, animation, layout)?)
}

fn ask(
    backend: Box<dyn Backend>,
    animation: &Arc<Animation>,
    layout: Layout,
) -> Result<Hits, Failed> {
    let method = Method {
        intersector: Intersector::Exact,
        layout,
    };
    let mut stage = Stage::over(backend, animation, method);
    stage.plant(0.0);
    let kind = QueryKind::ClosestAndShadow {
        light: [40.0, 0.3, 6.0],
    };
    let rays = Rays::Camera(&camera());
    Ok(stage.try_trace(0.0, rays, kind)?)
}
