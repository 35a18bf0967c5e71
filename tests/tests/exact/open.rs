//! Pictures in which every hit is a tie, so that a device's first search leaves them all open, and their shadows too.

use crate::Device;
use backend::{Intersector, Query, QueryKind, Rays};
use geom::Animation;
use integration::rays::{camera, light};
use integration::stage::Stage;
use libtest_mimic::{Failed, Trial};
use std::sync::Arc;

pub(crate) fn trial(device: Device) -> Trial {
    device.trial("shadows_of_hits_that_were_left_open", doubled)
}

/// Every triangle twice, and some once more, turned round.
fn twice(animation: &Animation) -> Result<Arc<Animation>, Failed> {
    let triangles = animation.triangles();
    let turned = triangles.iter().step_by(3).map(|&[a, b, c]| [b, c, a]);
    let all = triangles.iter().chain(triangles).copied().chain(turned);
    let frames = animation.keys().to_vec();
    let doubled = Animation::new(frames, all.collect()).map_err(|e| e.to_string())?;
    Ok(Arc::new(doubled))
}

fn doubled(device: Device) -> Result<(), Failed> {
    let opened = scene::open("demo:collide:2000", &scene::Options::default());
    let animation = twice(&opened.map_err(|e| e.to_string())?.animation)?;
    let time = 0.4 * animation.end();
    let camera = camera(&animation, [150, 90]);
    let kind = QueryKind::ClosestAndShadow {
        light: light(&animation),
    };
    let query = Query {
        rays: Rays::Camera(&camera),
        kind,
    };
    let ask = |mut stage: Stage| {
        stage.plant(0.0);
        stage.try_trace(time, query)
    };
    let expected = ask(Stage::new(&animation, Intersector::Exact, 2))?;
    let found = ask(Stage::over(device.open()?, &animation, Intersector::Exact))?;
    let hits = expected.closest.iter().filter(|h| h.is_hit()).count();
    let blocked = expected.blocked.iter().filter(|&&b| b == 1).count();
    if hits < 1000 || blocked < 100 || blocked + 100 > hits {
        return Err(format!("{hits} hits, {blocked} in shadow: too few to tell").into());
    }
    for (i, (a, b)) in expected.closest.iter().zip(&found.closest).enumerate() {
        if a != b {
            return Err(format!("pixel {i}: {b:?}, not {a:?}").into());
        }
    }
    match (0..expected.blocked.len()).find(|&i| expected.blocked[i] != found.blocked[i]) {
        Some(i) => Err(format!("pixel {i}: in shadow {}", found.blocked[i]).into()),
        None => Ok(()),
    }
}
