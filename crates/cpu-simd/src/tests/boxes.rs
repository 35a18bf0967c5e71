//! Tests of the boxes of inner nodes against the box test of `cpu-ref`.

use crate::rays::{InputRays, OneRay, PreparedRays};
use crate::simd::{InstructionSet, Isa, Lanes, Plain, VectorWork};
use crate::tree::{BoxPlanes, EMPTY, LANES, set_bounds};
use crate::walk::{BoxTest, NodeRay};
use cpu_ref::scale::{PreparedRay, Scale};
use cpu_ref::{BoxRay, BoxSpan};
use geom::{Aabb, Point, Ray};
use proptest::prelude::*;

fn near(reach: f32) -> impl Strategy<Value = Point> {
    [-reach..reach, -reach..reach, -reach..reach]
}

/// A root box, near the origin or far from it, and a box within it.
fn boxes() -> impl Strategy<Value = [Aabb; 2]> {
    let middle = prop_oneof![near(1.0), near(1e3), near(1e6)];
    (middle, near(1.0), near(1.0)).prop_map(|(middle, a, b)| {
        let corners = [a, b].map(|p| std::array::from_fn(|i| middle[i] + p[i]));
        let unit = |side: f32| std::array::from_fn(|i| middle[i] + side);
        let around = |points: [Point; 2]| {
            let all = points.iter();
            all.fold(Aabb::EMPTY, |bounds, &p| bounds.with_point(p))
        };
        [around([unit(-1.0), unit(1.0)]), around(corners)]
    })
}

/// A ray towards a point on the surface of a box or inside, from near or far. Some are along an axis.
fn ray_to(bounds: Aabb) -> impl Strategy<Value = Ray> {
    let away = prop_oneof![4 => near(3.0), 2 => near(1e4), 1 => near(1e38)];
    let on = prop::array::uniform3(prop_oneof![Just(0.0_f32), Just(1.0), 0.0_f32..1.0]);
    let axes =
        prop::array::uniform3(prop_oneof![6 => Just(1.0_f32), 1 => Just(0.0), 1 => Just(1e-15)]);
    (away, on, axes).prop_map(move |(away, on, axes)| {
        let at: Point = std::array::from_fn(|i| bounds.min[i] + on[i] * bounds.extent()[i]);
        let from: Point = std::array::from_fn(|i| at[i] + axes[i] * away[i]);
        let t_min = if away[0] < 0.0 {
            f32::NEG_INFINITY
        } else {
            0.0
        };
        Ray {
            t_min,
            ..Ray::new(from, std::array::from_fn(|i| at[i] - from[i]))
        }
    })
}

/// Computes the lanes of `planes` that a ray meets, and its entry distance in each.
struct Meet<'a, R: Lanes> {
    ray: &'a OneRay<'a, R>,
    planes: BoxPlanes,
    /// Set if the padding of a box is computed from that box instead of the root box.
    own_padding: bool,
}

impl<R: Lanes> VectorWork for Meet<'_, R> {
    type Out = (u32, [f32; LANES]);

    #[inline(always)]
    fn run<I: Isa>(self) -> (u32, [f32; LANES]) {
        let node_ray = NodeRay::<I::Eight>::new(self.ray, self.own_padding);
        let met = node_ray.meet(&self.planes, f32::INFINITY);
        (met.lanes, met.entry.store())
    }
}

/// Tests that a ray meets `bounds` if it does so in `cpu-ref`, and enters no later. `expected` is the result of
/// `cpu-ref`.
fn check(
    ray: &OneRay<'_, impl Lanes>,
    bounds: &Aabb,
    expected: Option<BoxSpan>,
) -> Result<(), TestCaseError> {
    let lane = 5;
    let mut planes = EMPTY;
    set_bounds(&mut planes, lane, bounds);
    let kinds = InstructionSet::all()
        .into_iter()
        .flat_map(|instruction_set| [(instruction_set, false), (instruction_set, true)]);
    for (instruction_set, own_padding) in kinds {
        let meet = Meet {
            ray,
            planes,
            own_padding,
        };
        let (lanes, entries) = instruction_set.run(meet);
        prop_assert_eq!(lanes & !(1 << lane), 0, "empty lanes are never met");
        if let Some(BoxSpan { entry, exit }) = expected {
            prop_assert_eq!(
                lanes,
                1 << lane,
                "{:?}: {} {}",
                instruction_set,
                entry,
                exit
            );
            prop_assert!(entries[lane] <= entry, "{:?}", instruction_set);
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn visits_boxes_that_rays_hit(
        (boxes, ray) in boxes().prop_flat_map(|boxes| (Just(boxes), ray_to(boxes[1]))),
    ) {
        let [root, bounds] = boxes;
        let Some(prepared) = PreparedRay::new(&ray, Scale::ONE) else {
            return Ok(());
        };
        let expected = BoxRay::new(&prepared).meet(&bounds, f32::INFINITY);
        let alone = PreparedRays::alone(&prepared, &root);
        check(&OneRay { group: &alone, lane: 0 }, &bounds, expected)?;
        let group = PreparedRays::<Plain<8>>::new(&InputRays::listed(&[ray]), Scale::ONE, &root);
        if group.ready & 1 == 1 {
            check(&OneRay { group: &group, lane: 0 }, &bounds, expected)?;
        }
    }
}
