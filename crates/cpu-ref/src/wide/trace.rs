//! Rays to hits by the wide tree, task by task.

use super::search::{any, closest};
use super::tree::Wide;
use crate::preprocess::Geometry;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::shadow::Light;
use crate::simd::{Isa, Work};
use crate::slab::Reach;
use crate::tiles::{Tiles, fill_list, fill_picture};
use crate::trace::ray;
use crate::traverse::{self, Stack};
use crate::watertight::Watertight;
use backend::Rays;
use geom::{Hit, Point, Ray};

/// Rays, and what they are traced through.
#[derive(Clone, Copy)]
pub(crate) struct WideTracer<'a> {
    pub(crate) rays: Rays<'a>,
    pub(crate) tree: &'a Wide,
    pub(crate) geometry: Geometry<'a>,
}

impl WideTracer<'_> {
    /// Closest hits, in the rays' order; returns how many rays hit.
    pub(crate) fn closest(self, out: &mut [Hit]) -> u64 {
        self.fill(out, &Closest(self))
    }

    /// 1 for each ray that hits anything; returns how many do.
    pub(crate) fn any(self, out: &mut [u8]) -> u64 {
        self.fill(out, &Any(self))
    }

    /// 1 for each of `hits` that the light does not reach; returns how many.
    pub(crate) fn shadow(self, hits: &[Hit], light: Point, out: &mut [u8]) -> u64 {
        let light = Light::new(light, self.geometry.scale, &self.tree.root);
        let job = Shadow {
            tracer: self,
            hits,
            light,
        };
        self.fill(out, &job)
    }

    fn fill<J: Job>(&self, out: &mut [J::Answer], job: &J) -> u64 {
        let level = self.tree.level;
        match self.rays {
            Rays::Camera(camera) if !out.is_empty() => {
                fill_picture(out, camera.width as usize, |tiles| {
                    level.run(PictureTask { tiles, job })
                })
            }
            _ => fill_list(out, |first, out| level.run(ListTask { first, out, job })),
        }
    }

    #[inline(always)]
    fn closest_of<I: Isa>(&self, ray: &Ray, scale: Scale, stack: &mut Stack) -> Hit {
        let Some(ray) = PreparedRay::new(ray, scale) else {
            return Hit::MISS;
        };
        let reach = Reach::new(&ray, &self.tree.root);
        let hit = if reach.is_calm() {
            closest::<I>(self.tree, &ray, &reach, &mut stack.wide)
        } else {
            traverse::closest::<_, Watertight>(self.tree, &ray, stack)
        };
        match hit {
            Some(hit) => Hit {
                t: ray.unscaled(hit.t),
                ..hit
            },
            None => Hit::MISS,
        }
    }

    #[inline(always)]
    fn any_of<I: Isa>(
        &self,
        ray: &Ray,
        scale: Scale,
        skipped: Option<u32>,
        stack: &mut Stack,
    ) -> bool {
        let Some(ray) = PreparedRay::new(ray, scale) else {
            return false;
        };
        let reach = Reach::new(&ray, &self.tree.root);
        if reach.is_calm() {
            any::<I>(self.tree, &ray, &reach, skipped, &mut stack.wide)
        } else {
            traverse::any::<_, Watertight>(self.tree, &ray, skipped, stack)
        }
    }
}

/// One question for every ray.
trait Job: Sync {
    type Answer: Send;

    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> (Self::Answer, bool);
}

struct Closest<'a>(WideTracer<'a>);

impl Job for Closest<'_> {
    type Answer = Hit;

    #[inline(always)]
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> (Hit, bool) {
        let ray = ray(self.0.rays, index);
        let hit = self.0.closest_of::<I>(&ray, self.0.geometry.scale, stack);
        (hit, hit.is_hit())
    }
}

struct Any<'a>(WideTracer<'a>);

impl Job for Any<'_> {
    type Answer = u8;

    #[inline(always)]
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> (u8, bool) {
        let ray = ray(self.0.rays, index);
        let hit = self.0.any_of::<I>(&ray, self.0.geometry.scale, None, stack);
        (u8::from(hit), hit)
    }
}

struct Shadow<'a> {
    tracer: WideTracer<'a>,
    hits: &'a [Hit],
    light: Light,
}

impl Job for Shadow<'_> {
    type Answer = u8;

    #[inline(always)]
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> (u8, bool) {
        let hit = &self.hits[index];
        if !hit.is_hit() {
            return (0, false);
        }
        let geometry = &self.tracer.geometry;
        let eye = geometry.scale.apply(ray(self.tracer.rays, index).origin);
        let corners = geometry.scaled_corners(hit.triangle);
        let ray = self.light.ray(hit, &corners, eye);
        let skipped = Some(hit.triangle);
        let blocked = self.tracer.any_of::<I>(&ray, Scale::ONE, skipped, stack);
        (u8::from(blocked), blocked)
    }
}

struct ListTask<'a, J: Job> {
    first: usize,
    out: &'a mut [J::Answer],
    job: &'a J,
}

impl<J: Job> Work for ListTask<'_, J> {
    type Out = u64;

    #[inline(always)]
    fn run<I: Isa>(self) -> u64 {
        let (mut stack, mut count) = (Stack::new(), 0);
        for (index, entry) in (self.first..).zip(self.out) {
            let (answer, counts) = self.job.one::<I>(index, &mut stack);
            *entry = answer;
            count += u64::from(counts);
        }
        count
    }
}

struct PictureTask<'a, J: Job> {
    tiles: Tiles<'a, J::Answer>,
    job: &'a J,
}

impl<J: Job> Work for PictureTask<'_, J> {
    type Out = u64;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> u64 {
        let (mut stack, mut count) = (Stack::new(), 0);
        let (width, height) = (self.tiles.columns(), self.tiles.height());
        for tile in (0..width).step_by(8) {
            for y in 0..height {
                for x in tile..width.min(tile + 8) {
                    let (index, entry) = self.tiles.entry(x, y);
                    let (answer, counts) = self.job.one::<I>(index, &mut stack);
                    *entry = answer;
                    count += u64::from(counts);
                }
            }
        }
        count
    }
}
