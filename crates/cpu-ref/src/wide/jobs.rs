//! What is asked of each ray.

use super::cell::Cell;
use super::few::Few;
use super::found::ClosestHits;
use super::single::Given;
use super::together::MOST_RAYS;
use super::trace::WideTracer;
use super::trust::Trust;
use crate::scale::Scale;
use crate::shadow::Light;
use crate::simd::{Isa, Lanes, each};
use crate::trace::Answer;
use crate::traverse::Stack;
use crate::watertight::Watertight;
use backend::Rays;
use geom::Hit;

/// One question for every ray. Whatever is generic here must be `#[inline(always)]`.
pub(super) trait Job: Sync {
    type Answer: Answer;

    /// The rays, and what they are traced through.
    fn tracer(&self) -> &WideTracer<'_>;

    /// The answer for one ray by itself.
    fn one(&self, index: usize, stack: &mut Stack) -> Self::Answer;

    /// The answers for a few rays of a list, some of which are extreme.
    #[cold]
    #[inline(never)]
    fn singly(&self, few: &Few, stack: &mut Stack) -> [Self::Answer; MOST_RAYS] {
        let mut answers = [self.one(few.index(0), stack); MOST_RAYS];
        for (lane, answer) in answers.iter_mut().enumerate().skip(1) {
            if few.asked >> lane & 1 == 1 {
                *answer = self.one(few.index(lane), stack);
            }
        }
        answers
    }

    /// The answers for a few rays of a list.
    fn few<I: Isa>(&self, few: &Few, stack: &mut Stack) -> [Self::Answer; MOST_RAYS];

    /// The answers for the rays of a cell, one a lane.
    fn cell<I: Isa>(
        &self,
        cell: &Cell,
        trust: &mut Trust,
        stack: &mut Stack,
    ) -> [Self::Answer; MOST_RAYS];
}

/// The closest hit of each ray.
pub(super) struct Closest<'a>(pub(super) WideTracer<'a>);

impl Job for Closest<'_> {
    type Answer = Hit;

    fn tracer(&self) -> &WideTracer<'_> {
        &self.0
    }

    fn one(&self, index: usize, stack: &mut Stack) -> Hit {
        self.0.singly().closest_at::<Watertight>(index, stack)
    }

    #[inline(always)]
    fn few<I: Isa>(&self, few: &Few, stack: &mut Stack) -> [Hit; MOST_RAYS] {
        self.0.closest_each::<I>(few, stack).hits
    }

    #[inline(always)]
    fn cell<I: Isa>(&self, cell: &Cell, trust: &mut Trust, stack: &mut Stack) -> [Hit; MOST_RAYS] {
        self.0.closest_of::<I>(cell, trust, stack).hits
    }
}

/// Whether each ray hits anything.
pub(super) struct Any<'a>(pub(super) WideTracer<'a>);

impl Job for Any<'_> {
    type Answer = u8;

    fn tracer(&self) -> &WideTracer<'_> {
        &self.0
    }

    fn one(&self, index: usize, stack: &mut Stack) -> u8 {
        self.0.singly().any_at::<Watertight>(index, stack)
    }

    #[inline(always)]
    fn few<I: Isa>(&self, few: &Few, stack: &mut Stack) -> [u8; MOST_RAYS] {
        flags(self.0.any_each_of::<I>(few, stack))
    }

    #[inline(always)]
    fn cell<I: Isa>(&self, cell: &Cell, trust: &mut Trust, stack: &mut Stack) -> [u8; MOST_RAYS] {
        flags(self.0.any_of::<I>(cell, trust, stack))
    }
}

/// 1 for each lane that is set.
#[inline(always)]
fn flags(lanes: u32) -> [u8; MOST_RAYS] {
    let mut flags = [0; MOST_RAYS];
    for (lane, flag) in flags.iter_mut().enumerate() {
        *flag = (lanes >> lane & 1) as u8;
    }
    flags
}

/// The closest hit of each ray, and whether the light does not reach it: at once, while all that the ray came to is
/// in the nearest caches.
pub(super) struct ClosestAndShadow<'a> {
    pub(super) tracer: WideTracer<'a>,
    pub(super) light: Light,
}

impl Job for ClosestAndShadow<'_> {
    type Answer = (Hit, u8);

    fn tracer(&self) -> &WideTracer<'_> {
        &self.tracer
    }

    fn one(&self, index: usize, stack: &mut Stack) -> (Hit, u8) {
        let singly = self.tracer.singly();
        let hit = singly.closest_at::<Watertight>(index, stack);
        let blocked = singly.blocked_at::<Watertight>((index, &hit), &self.light, stack);
        (hit, blocked)
    }

    #[inline(always)]
    fn few<I: Isa>(&self, few: &Few, stack: &mut Stack) -> [(Hit, u8); MOST_RAYS] {
        let tracer = &self.tracer;
        let found = tracer.closest_each::<I>(few, stack);
        let given = Given::<I::Packet>::of(&few.rays(tracer.rays));
        let eyes = given.scaled_origin(tracer.geometry.scale);
        self.with_shadows::<I>(&found, few.asked, &eyes, stack)
    }

    #[inline(always)]
    fn cell<I: Isa>(
        &self,
        cell: &Cell,
        trust: &mut Trust,
        stack: &mut Stack,
    ) -> [(Hit, u8); MOST_RAYS] {
        let tracer = &self.tracer;
        let Rays::Camera(camera) = tracer.rays else {
            return self.few::<I>(&Few::of(cell), stack);
        };
        let found = tracer.closest_of::<I>(cell, trust, stack);
        let eye = tracer.geometry.scale.apply(camera.eye);
        let eyes = each!(i => I::Packet::splat(eye[i]));
        self.with_shadows::<I>(&found, cell.asked, &eyes, stack)
    }
}

impl ClosestAndShadow<'_> {
    /// What was found of the rays of `asked`, which started from `eyes`, and whether the light does not reach it.
    #[inline(always)]
    fn with_shadows<I: Isa>(
        &self,
        found: &ClosestHits,
        asked: u32,
        eyes: &[I::Packet; 3],
        stack: &mut Stack,
    ) -> [(Hit, u8); MOST_RAYS] {
        let asked = asked & found.lanes();
        if asked == 0 {
            return found.with(0);
        }
        let corners = found.corners::<I>(&self.tracer);
        let [origin, direction] = self.light.rays(&corners, found.weights::<I>(), eyes);
        let rays = Given {
            origin,
            direction,
            limits: [I::Packet::splat(0.0), I::Packet::splat(1.0)],
        };
        let asked = (asked, &found.triangles());
        let blocked = self.tracer.any_each::<I>((&rays, Scale::ONE), asked, stack);
        found.with(blocked)
    }
}
