//! The same bits from every form of the kernels on wgpu, from Vulkan on the same adapter, and from the host.

use crate::scenes::{SHADOWED, bits, camera, go, hits, open_laid, rays, report, stand, swarm};
use backend::{Backend, BackendError, Layout, QueryKind, Rays};
use cpu_ref::CpuBackend;
use geom::Animation;
use gpu_vulkan::VulkanBackend;
use gpu_wgpu::{Options, WgpuBackend};

type Named = (String, Box<dyn Backend>);

/// The host, wgpu with each form of the kernels, and Vulkan.
fn backends() -> Vec<Named> {
    let cpu = CpuBackend::new(Some(2)).unwrap();
    let mut all: Vec<Named> = vec![("cpu".into(), Box::new(cpu))];
    for (name, force_wgsl, checked) in [
        ("best", false, false),
        ("wgsl", true, false),
        ("checked wgsl", false, true),
    ] {
        let backend = WgpuBackend::new(&Options {
            force_wgsl,
            checked,
            ..Options::default()
        });
        all.push((format!("wgpu, {name}"), Box::new(backend.unwrap())));
    }
    let adapter = all[1].1.device().adapter.clone();
    let options = gpu_vulkan::Options {
        adapter: Some(adapter),
        ..Default::default()
    };
    match VulkanBackend::new(&options) {
        Ok(vulkan) => all.push(("vulkan".into(), Box::new(vulkan))),
        // Where wgpu reaches its adapter by Metal or DirectX 12.
        Err(BackendError::NoDevice(_)) => (),
        Err(e) => panic!("{e}"),
    }
    all
}

pub(crate) fn every_variant_answers_as_its_twins_do() {
    let mut all = backends();
    for layout in Layout::ALL {
        answer_alike(&mut all, layout);
    }
    // So large that `preprocess` of layout `fast` waits for positions.
    let animation = swarm(600_000);
    let boxes = all.iter_mut().map(|(name, backend)| {
        open_laid(backend.as_mut(), &animation, Layout::Fast);
        stand(backend.as_mut(), &animation, 0.7);
        let times = report(backend.as_mut()).times;
        let waited = times.interpolate_ms.is_some() || times.preprocess_ms.is_none();
        assert!(waited, "{name} did not wait");
        (name, backend.inspect().boxes().unwrap())
    });
    let expected = boxes.reduce(|(name, boxes), (other, found)| {
        assert!(found == boxes, "{other} has other boxes than {name}");
        (name, boxes)
    });
    assert!(expected.is_some());
}

fn answer_alike(all: &mut [Named], layout: Layout) {
    let (animation, camera, list) = (swarm(600), camera(), rays(1500));
    for (_, backend) in all.iter_mut() {
        open_laid(backend.as_mut(), &animation, layout);
    }
    let queries = [
        (Rays::Camera(&camera), SHADOWED),
        (Rays::Camera(&camera), QueryKind::Closest),
        (Rays::List(&list), SHADOWED),
        (Rays::List(&list), QueryKind::Closest),
        (Rays::List(&list), QueryKind::Any),
    ];
    for ((rays, kind), time) in queries.into_iter().zip([0.0, 0.37, 1.0, 1.75, 2.0]) {
        let mut each = all.iter_mut().map(|(name, backend)| {
            let found = answers(backend.as_mut(), &animation, time, rays, kind);
            (name, found)
        });
        let (_, expected) = each.next().unwrap();
        let [met, _, inactive, flat] = expected.counts;
        assert!(met > 100, "the scene is in sight: {met}");
        assert!(inactive > 0 && flat > 0, "some are left out");
        for (name, found) in each {
            assert!(found == expected, "{name}, {layout}, {kind:?} at {time}");
        }
    }
}

/// Everything a backend can be asked of a moment, as bits.
#[derive(Debug, PartialEq)]
pub(crate) struct Answers {
    pub(crate) positions: Vec<[Option<u32>; 3]>,
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
) -> Answers {
    stand(backend, animation, time);
    let ticket = go(backend, rays, kind);
    let report = backend.wait(ticket).unwrap();
    let hits = hits(backend, ticket);
    let boxes = backend.inspect().boxes().unwrap();
    let positions = backend.inspect().positions().unwrap();
    let words = |h: &geom::Hit| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.triangle];
    // A minimum of 0 and -0 may be either, so boxes are compared by value: adding 0 makes both 0.
    let plain = |x: f32| (x + 0.0).to_bits();
    let corners = |b: &geom::Aabb| -> [u32; 6] {
        std::array::from_fn(|i| plain(if i < 3 { b.min[i] } else { b.max[i - 3] }))
    };
    Answers {
        positions: bits(&positions),
        boxes: boxes.iter().map(corners).collect(),
        hits: hits.closest.iter().map(words).collect(),
        shadows: hits.blocked,
        counts: [
            report.hits,
            report.blocked,
            report.inactive,
            report.degenerate,
        ],
    }
}
