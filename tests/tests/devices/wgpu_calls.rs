//! What a frame asks of wgpu, in counts that are the same on every machine.

use crate::scenes::{SHADOWED, arrive, camera, go, open_laid, stand, swarm, tree_at};
use backend::{Backend, Generation, Layout, Rays};
use bvh_layout::{Topology, Treelets};
use gpu_common::Options;
use gpu_wgpu::{CallCounts, WgpuBackend};

/// One frame as the program renders it: positions go back every third time.
fn frame(backend: &mut WgpuBackend, animation: &geom::Animation, i: u32) -> CallCounts {
    let before = backend.gpu().call_counts();
    stand(backend, animation, 0.03 * f64::from(i % 20));
    if i.is_multiple_of(3) {
        backend.request_positions().unwrap();
    }
    let ticket = go(backend, Rays::Camera(&camera()), SHADOWED);
    let spent = backend.gpu().call_counts() - before;
    backend.wait(ticket).unwrap();
    if i.is_multiple_of(3) {
        arrive(backend);
    }
    spent
}

pub(crate) fn a_steady_frame_makes_no_buffer_and_no_bind_group() {
    Layout::ALL.into_iter().for_each(tally_of_steady_frames);
}

/// Dispatches of a refit but for the sum of costs.
fn refits(tree: &Topology, layout: Layout) -> u64 {
    match layout {
        // A level each, and their sum.
        Layout::Bvh2 => tree.levels().filter(|inner| !inner.is_empty()).count() as u64 + 1,
        // All of a small tree is refitted as it is preprocessed.
        Layout::Fast => {
            assert!(Treelets::of(tree).levels.len() > 1);
            0
        }
    }
}

fn tally_of_steady_frames(layout: Layout) {
    let animation = swarm(3000);
    let mut backend = WgpuBackend::new(&Options::default()).unwrap();
    open_laid(&mut backend, &animation, layout);
    // Both places of a record, all slots, all buffers for traces and positions.
    let mut generation = 1;
    for i in 0..24 {
        if i % 8 == 7 {
            generation += 1;
            let tree = tree_at(&animation, 0.0);
            backend.adopt(&tree, Generation(generation)).unwrap();
        }
        frame(&mut backend, &animation, i);
    }
    // Rays with their shadows take one; with layout `fast` five, where the device finds hits of so many triangles by rasterization.
    let refits_now = refits(&tree_at(&animation, 0.0), layout);
    let rays = frame(&mut backend, &animation, 24).dispatches - 2 - refits_now;
    assert!(rays == 1 || (rays == 5 && layout == Layout::Fast), "{rays}");
    let expected = CallCounts {
        buffers: 0,
        bind_groups: 0,
        uploads: 1,
        // Geometry's and that of rays.
        passes: 2,
        // interpolate, preprocess, refit, rays
        dispatches: 2 + refits_now + rays,
        submissions: 1,
    };
    for i in 25..48 {
        assert_eq!(frame(&mut backend, &animation, i), expected, "frame {i}");
    }
    // A new tree costs the submission that brings it, and one dispatch, no more.
    let (before, tree) = (backend.gpu().call_counts(), tree_at(&animation, 0.3));
    backend.adopt(&tree, Generation(generation + 1)).unwrap();
    let spent = backend.gpu().call_counts() - before;
    assert_eq!((spent.uploads, spent.submissions), (0, 1));
    let spent = frame(&mut backend, &animation, 48);
    assert_eq!(spent.dispatches, 2 + 1 + refits(&tree, layout) + rays);
    assert_eq!((spent.buffers, spent.submissions), (0, 1));
}
