//! Rays to hits by the wide tree, task by task.

use super::cell::{COLUMNS, Cell};
use super::jobs::{Any, Closest, Shadow};
use super::search::{any, closest};
use super::single::{Group, InGroup, SingleRay};
use super::together::MOST_RAYS;
use super::tree::Wide;
use crate::preprocess::Geometry;
use crate::ray::PreparedRay;
use crate::scale::Scale;
use crate::shadow::Light;
use crate::simd::{Isa, Lanes, Work};
use crate::slab::Reach;
use crate::tiles::{Tiles, fill_list, fill_picture};
use crate::traverse::{self, Stack};
use crate::watertight::Watertight;
use backend::Rays;
use geom::{Aabb, Hit, Point, Ray};

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
    pub(super) fn closest_of<I: Isa>(&self, ray: &Ray, scale: Scale, stack: &mut Stack) -> Hit {
        let Some(ray) = PreparedRay::new(ray, scale) else {
            return Hit::MISS;
        };
        let reach = Reach::new(&ray, &self.tree.root);
        let hit = if reach.is_calm() {
            let single = SingleRay::new(&ray, &reach);
            closest::<I>(self.tree, &single, &mut stack.wide)
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
    pub(super) fn any_of<I: Isa>(
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
            let single = SingleRay::new(&ray, &reach);
            any::<I>(self.tree, &single, skipped, &mut stack.wide)
        } else {
            traverse::any::<_, Watertight>(self.tree, &ray, skipped, stack)
        }
    }
}

/// One question for every ray.
pub(super) trait Job: Sync {
    type Answer: Copy + Send;
    /// For a ray that was not asked.
    const NONE: Self::Answer;

    /// The answer for one ray. Must be `#[inline(always)]`, like the next.
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> Self::Answer;

    /// The ray of that index, in the units of [`Job::scale`]; `None` if it is not asked.
    fn ray(&self, index: usize) -> Option<Ray>;

    /// What rays are scaled by, and the box of the whole tree.
    fn scale(&self) -> Scale;
    fn root(&self) -> &Aabb;

    /// The answer for a ray prepared in a lane of a group.
    fn prepared<I: Isa>(
        &self,
        index: usize,
        ray: InGroup<'_, I::Packet>,
        stack: &mut Stack,
    ) -> Self::Answer;

    /// The answers for the rays of a cell, one a lane; `None` where they cannot run together.
    fn together<I: Isa>(&self, cell: &Cell, stack: &mut Stack)
    -> Option<[Self::Answer; MOST_RAYS]>;

    /// Flags of rays that hit and, one by one, of those that are left.
    #[inline(always)]
    fn flags<I: Isa>(
        &self,
        cell: &Cell,
        [hit, left]: [u32; 2],
        stack: &mut Stack,
    ) -> [Self::Answer; MOST_RAYS]
    where
        Self::Answer: From<bool>,
    {
        let mut flags = [Self::NONE; MOST_RAYS];
        for (lane, flag) in flags.iter_mut().enumerate() {
            if left >> lane & 1 == 1 {
                *flag = self.one::<I>(cell.index(lane), stack);
            } else {
                *flag = (hit >> lane & 1 == 1).into();
            }
        }
        flags
    }

    /// Whether an answer is counted.
    fn counts(answer: &Self::Answer) -> bool;
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
        let lanes = I::Packet::ALL.count_ones() as usize;
        let mut first = self.first;
        for out in self.out.chunks_mut(lanes) {
            fill_run::<I, J>(self.job, first, out, &mut stack);
            first += lanes;
            for answer in &*out {
                count += u64::from(J::counts(answer));
            }
        }
        count
    }
}

/// The answers of neighbouring rays of a list, prepared together and traced one by one.
#[inline(always)]
fn fill_run<I: Isa, J: Job>(job: &J, first: usize, out: &mut [J::Answer], stack: &mut Stack) {
    let mut rays = [NO_RAY; MOST_RAYS];
    for (lane, ray) in rays.iter_mut().enumerate().take(out.len()) {
        if let Some(asked) = job.ray(first + lane) {
            *ray = asked;
        }
    }
    let group = Group::<I::Packet>::new(&rays, job.scale(), job.root());
    for (lane, answer) in out.iter_mut().enumerate() {
        *answer = if group.ready >> lane & 1 == 1 {
            let ray = InGroup {
                group: &group,
                lane,
            };
            job.prepared::<I>(first + lane, ray, stack)
        } else {
            job.one::<I>(first + lane, stack)
        };
    }
}

/// Cannot hit anything.
const NO_RAY: Ray = Ray {
    origin: [0.0; 3],
    t_min: 0.0,
    direction: [0.0; 3],
    t_max: 0.0,
};

struct PictureTask<'a, J: Job> {
    tiles: Tiles<'a, J::Answer>,
    job: &'a J,
}

impl<J: Job> Work for PictureTask<'_, J> {
    type Out = u64;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> u64 {
        let (mut stack, mut count) = (Stack::new(), 0);
        let size = [self.tiles.columns(), self.tiles.height()];
        let rows = I::Packet::ALL.count_ones() as usize / COLUMNS;
        for x in (0..size[0]).step_by(COLUMNS) {
            for y in (0..size[1]).step_by(rows) {
                count += self.fill_cell::<I>([x, y], [COLUMNS, rows], &mut stack);
            }
        }
        count
    }
}

impl<J: Job> PictureTask<'_, J> {
    /// Returns how many of the answers count.
    #[inline(always)]
    fn fill_cell<I: Isa>(&mut self, at: [usize; 2], size: [usize; 2], stack: &mut Stack) -> u64 {
        let cell = Cell::new(&self.tiles, at, size);
        let answers = match self.job.together::<I>(&cell, stack) {
            Some(answers) => answers,
            None => one_by_one::<I, J>(self.job, &cell, stack),
        };
        let mut count = 0;
        for (lane, answer) in answers.iter().enumerate() {
            if cell.asked >> lane & 1 == 1 {
                let (x, y) = (at[0] + lane % size[0], at[1] + lane / size[0]);
                *self.tiles.entry(x, y) = *answer;
                count += u64::from(J::counts(answer));
            }
        }
        count
    }
}

/// The answers of a cell's rays, each on its own.
#[inline(always)]
fn one_by_one<I: Isa, J: Job>(job: &J, cell: &Cell, stack: &mut Stack) -> [J::Answer; MOST_RAYS] {
    let mut answers = [J::NONE; MOST_RAYS];
    for (lane, answer) in answers.iter_mut().enumerate() {
        if cell.asked >> lane & 1 == 1 {
            *answer = job.one::<I>(cell.index(lane), stack);
        }
    }
    answers
}
