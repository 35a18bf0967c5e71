//! Small scenes and the few sentences in which trials are written.

use backend::{Backend, Generation, Hits, Layout, Method, Query, QueryKind, Rays, Result, Ticket};
use bvh_build::{BinaryTree, Builder, Cancel};
use bvh_layout::{Converter, Topology};
use geom::{Animation, Camera, Point, Ray};
use std::sync::Arc;

/// Numbers in -1..1 that are the same everywhere (SplitMix64).
pub(crate) fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }
}

/// Triangles that fly about over three key frames, some of them inactive or degenerate at times.
pub(crate) fn swarm(triangles: u32) -> Arc<Animation> {
    let mut number = numbers(7);
    let mut point = move || [number(), number(), number()];
    let mut key = |k: u32| -> Vec<Point> {
        let mut corners = Vec::new();
        for t in 0..triangles {
            let (at, b, c) = (point(), point(), point());
            let beside = |d: Point| std::array::from_fn(|i| at[i] + 0.2 * d[i]);
            let broken = t % 41 == 3 && k == 1 || t % 53 == 5;
            let flat = t % 37 == 2;
            corners.push(if broken { [f32::NAN; 3] } else { at });
            corners.push(beside(b));
            corners.push(beside(if flat { b } else { c }));
        }
        corners
    };
    let keys = (0..3).map(&mut key).collect();
    let triangles = (0..triangles)
        .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
        .collect();
    Arc::new(Animation::new(keys, triangles).unwrap())
}

/// A tree over the scene as it stands at `time`.
pub(crate) fn tree_at(animation: &Animation, time: f64) -> Topology {
    let pose = animation.pose(time);
    let vertices: Vec<Point> = (0..animation.vertex_count() as u32)
        .map(|v| animation.vertex(pose, v))
        .collect();
    let mut tree = BinaryTree::default();
    let boxes = (animation, vertices.as_slice());
    Builder::new()
        .build(&boxes, &Cancel::new(), &mut tree)
        .unwrap();
    Converter::new().convert(&tree, animation.triangle_count(), Vec::new())
}

pub(crate) fn camera() -> Camera {
    Camera::look_at([0.3, 0.2, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 50.0, [70, 43]).unwrap()
}

/// Rays through the scene from all sides, some of them not valid.
pub(crate) fn rays(count: usize) -> Vec<Ray> {
    let mut number = numbers(11);
    let mut point = move |s: f32| [s * number(), s * number(), s * number()];
    let mut ray = || {
        let (from, to) = (point(2.0), point(0.8));
        Ray::new(from, std::array::from_fn(|i| to[i] - from[i]))
    };
    let mut all: Vec<Ray> = (0..count).map(|_| ray()).collect();
    all[0].direction = [0.0; 3];
    all[1].origin[2] = f32::INFINITY;
    all[2].t_max = 0.4;
    all
}

pub(crate) const SHADOWED: QueryKind = QueryKind::ClosestAndShadow {
    light: [2.0, 3.0, 2.5],
};

/// Loads the scene and adopts a tree built at its start.
pub(crate) fn open(backend: &mut dyn Backend, animation: &Arc<Animation>) -> Result<()> {
    open_laid(backend, animation, Layout::Bvh2)
}

pub(crate) fn open_laid(
    backend: &mut dyn Backend,
    animation: &Arc<Animation>,
    layout: Layout,
) -> Result<()> {
    let method = Method {
        layout,
        ..Method::default()
    };
    backend.load(Arc::clone(animation), method)?;
    backend.adopt(&tree_at(animation, 0.0), Generation(1))
}

/// Records everything but the trace.
pub(crate) fn stand(backend: &mut dyn Backend, animation: &Animation, time: f64) -> Result<()> {
    backend.interpolate(animation.pose(time))?;
    backend.preprocess()?;
    backend.refit()
}

/// Traces and submits.
pub(crate) fn go(backend: &mut dyn Backend, rays: Rays<'_>, kind: QueryKind) -> Result<Ticket> {
    backend.trace(Query { rays, kind })?;
    backend.submit()
}

pub(crate) fn hits(backend: &mut dyn Backend, ticket: Ticket) -> Result<Hits> {
    let mut hits = Hits::default();
    backend.hits(ticket, &mut hits)?;
    Ok(hits)
}

/// Bits of a coordinate. Which NaN an interpolation gives is the device's own affair: all are one.
pub(crate) fn bits(x: f32) -> u32 {
    if x.is_nan() {
        f32::NAN.to_bits()
    } else {
        x.to_bits()
    }
}

/// Everything a backend can be asked of a moment, as bits.
#[derive(Debug, PartialEq)]
pub(crate) struct Answers {
    pub(crate) positions: Vec<[u32; 3]>,
    pub(crate) boxes: Vec<[u32; 6]>,
    pub(crate) hits: Vec<[u32; 4]>,
    pub(crate) shadows: Vec<u8>,
    pub(crate) counts: [u64; 4],
}

pub(crate) fn answers(
    backend: &mut dyn Backend,
    animation: &Animation,
    time: f64,
    rays: Rays<'_>,
    kind: QueryKind,
) -> Result<Answers> {
    stand(backend, animation, time)?;
    let ticket = go(backend, rays, kind)?;
    let report = backend.wait(ticket)?;
    let hits = hits(backend, ticket)?;
    let boxes = backend.inspect().boxes()?;
    let positions = backend.inspect().positions()?;
    let words = |h: &geom::Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle];
    // A minimum of 0 and -0 may be either, so boxes are compared by value: adding 0 makes both 0.
    let plain = |x: f32| (x + 0.0).to_bits();
    let corners = |b: &geom::Aabb| -> [u32; 6] {
        std::array::from_fn(|i| plain(if i < 3 { b.min[i] } else { b.max[i - 3] }))
    };
    Ok(Answers {
        positions: positions.iter().map(|p| p.map(bits)).collect(),
        boxes: boxes.iter().map(corners).collect(),
        hits: hits.closest.iter().map(words).collect(),
        shadows: hits.blocked,
        counts: [
            report.hits,
            report.blocked,
            report.inactive,
            report.degenerate,
        ],
    })
}
