//! Rays that are prepared together and traced each on its own.

use super::few::Few;
use super::found::ClosestHits;
use super::search;
use super::single::{Given, Group, InGroup};
use super::together::{MOST_RAYS, NONE};
use super::trace::WideTracer;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::simd::Isa;
use crate::traverse::{self, Stack};
use crate::watertight::Watertight;
use geom::{Hit, Ray};

impl WideTracer<'_> {
    /// Closest hits.
    #[inline(always)]
    pub(super) fn closest_each<I: Isa>(&self, few: &Few, stack: &mut Stack) -> ClosestHits {
        let (scale, root) = (self.geometry.scale, &self.tree.root);
        let rays = few.rays(self.rays);
        let group = Group::<I::Packet>::new(&Given::of(&rays), scale, root);
        let mut found = ClosestHits::MISSES;
        for (lane, alone) in rays.iter().enumerate() {
            if (group.ready & few.asked) >> lane & 1 == 1 {
                let group = &group;
                let ray = InGroup { group, lane };
                let best = search::closest::<I>(self.tree, &ray, &mut stack.wide);
                if best.hit.is_hit() {
                    let t = ray.unscaled(best.hit.t);
                    found.hits[lane] = Hit { t, ..best.hit };
                    found.places[lane] = best.place;
                }
            } else if few.asked >> lane & 1 == 1 {
                found.hits[lane] = self.closest_unusual(alone, scale, stack);
            }
        }
        found
    }

    /// Which rays hit anything.
    #[inline(always)]
    pub(super) fn any_each_of<I: Isa>(&self, few: &Few, stack: &mut Stack) -> u32 {
        let rays = Given::<I::Packet>::of(&few.rays(self.rays));
        self.any_each::<I>((&rays, self.geometry.scale), (few.asked, &NONE), stack)
    }

    /// Which rays of `asked` hit any triangle but those left out.
    #[inline(always)]
    pub(super) fn any_each<I: Isa>(
        &self,
        (rays, scale): (&Given<I::Packet>, Scale),
        (asked, skipped): (u32, &[u32; MOST_RAYS]),
        stack: &mut Stack,
    ) -> u32 {
        let group = Group::<I::Packet>::new(rays, scale, &self.tree.root);
        let mut hit = 0;
        for (lane, &skipped) in skipped.iter().enumerate() {
            if (group.ready & asked) >> lane & 1 == 1 {
                let group = &group;
                let ray = InGroup { group, lane };
                let found = search::any::<I>(self.tree, &ray, skipped, &mut stack.wide);
                hit |= u32::from(found) << lane;
            } else if asked >> lane & 1 == 1 {
                let found = self.any_unusual(&rays.ray(lane), scale, skipped, stack);
                hit |= u32::from(found) << lane;
            }
        }
        hit
    }

    /// The closest hit of an unusual ray.
    #[cold]
    #[inline(never)]
    fn closest_unusual(&self, ray: &Ray, scale: Scale, stack: &mut Stack) -> Hit {
        let Some(ray) = PreparedRay::new(ray, scale) else {
            return Hit::MISS;
        };
        match traverse::closest::<_, Watertight>(self.tree, &ray, stack) {
            Some(hit) => Hit {
                t: ray.unscaled(hit.t),
                ..hit
            },
            None => Hit::MISS,
        }
    }

    /// Whether an unusual ray hits any triangle but `skipped`.
    #[cold]
    #[inline(never)]
    fn any_unusual(&self, ray: &Ray, scale: Scale, skipped: u32, stack: &mut Stack) -> bool {
        let ray = PreparedRay::new(ray, scale);
        ray.is_some_and(|ray| traverse::any::<_, Watertight>(self.tree, &ray, Some(skipped), stack))
    }
}
