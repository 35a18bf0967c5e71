//! The tree's cost as refit measures it, beside the host's.

use crate::scenes::{go, open, open_laid, rays, stand, swarm};
use crate::twins::variants;
use backend::{Backend, Layout, QueryKind, Rays};
use cpu_ref::CpuBackend;
use geom::Animation;
use gpu_wgpu::{Options, WgpuBackend};
use libtest_mimic::Failed;
use std::sync::Arc;

fn cost(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
) -> Result<Option<f64>, Failed> {
    stand(backend, animation, time)?;
    let ticket = backend.submit()?;
    Ok(backend.wait(ticket)?.sah_cost)
}

fn triangles(corners: &[[f32; 3]]) -> Arc<Animation> {
    let count = corners.len() as u32 / 3;
    let triangles = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    let animation = Animation::new(vec![corners.to_vec()], triangles.collect());
    Arc::new(animation.unwrap())
}

/// Levels of one group and of many, a lone leaf, no leaf, no area.
fn scenes() -> [Arc<Animation>; 7] {
    let corner = [[1.0, 2.0, 3.0], [2.0, 2.0, 3.5], [1.0, 3.0, 3.0]];
    let on_a_line = [[0.0; 3], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
    [
        swarm(20_000),
        swarm(600),
        swarm(2),
        triangles(&corner),
        triangles(&corner.map(|p| p.map(|x: f32| x * 1e12))),
        triangles(&[[f32::NAN; 3]; 3]),
        triangles(&on_a_line),
    ]
}

pub(crate) fn refit_measures_what_the_tree_costs() -> Result<(), Failed> {
    let mut host = CpuBackend::new(Some(2)).map_err(|e| e.to_string())?;
    for (name, options) in variants() {
        let mut backend = WgpuBackend::new(&options)?;
        let laid = Layout::ALL.map(|layout| scenes().map(|scene| (layout, scene)));
        for (i, (layout, animation)) in laid.iter().flatten().enumerate() {
            let layout = *layout;
            open(&mut host, animation)?;
            open_laid(&mut backend, animation, layout)?;
            // The tree is that of time 0: it gets old.
            for time in [0.0, 0.4, 1.7] {
                let expected = cost(&mut host, animation, time)?;
                let found = cost(&mut backend, animation, time)?;
                let what = format!("{name}, scene {i} at {time}: {found:?}, not {expected:?}");
                assert_eq!(found.is_some(), expected.is_some(), "{what}");
                let (found, expected) = (found.unwrap_or(1.0), expected.unwrap_or(1.0));
                assert!((found - expected).abs() <= 1e-4 * expected, "{what}");
                let again = cost(&mut backend, animation, time)?.unwrap_or(1.0);
                assert_eq!(found.to_bits(), again.to_bits(), "{what}, once more");
            }
        }
    }
    Ok(())
}

pub(crate) fn a_cost_stands_until_the_next_refit() -> Result<(), Failed> {
    let animation = swarm(300);
    let mut backend = WgpuBackend::new(&Options::default())?;
    open(&mut backend, &animation)?;
    let early = backend.submit()?;
    assert_eq!(backend.wait(early)?.sah_cost, None);
    let first = cost(&mut backend, &animation, 0.0)?;
    let ticket = go(&mut backend, Rays::List(&rays(8)), QueryKind::Closest)?;
    assert_eq!(backend.wait(ticket)?.sah_cost, first);
    assert!(cost(&mut backend, &animation, 1.0)? > first);
    Ok(())
}
