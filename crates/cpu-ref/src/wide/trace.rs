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

    /// The answer for one ray. Must be `#[inline(always)]`, like all others.
    fn one<I: Isa>(&self, index: usize, stack: &mut Stack) -> Self::Answer;

    /// What is traced through.
    fn tracer(&self) -> &WideTracer<'_>;

    /// The ray of that index, in the units of [`Job::scale`]; `None` if it is not asked.
    #[inline(always)]
    fn ray(&self, index: usize) -> Option<Ray> {
        Some(ray(self.tracer().rays, index))
    }

    /// What rays are scaled by.
    #[inline(always)]
    fn scale(&self) -> Scale {
        self.tracer().geometry.scale
    }

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
            let few = Few::row(first, out.len());
            let answers = one_by_one::<I, J>(self.job, &few, &mut stack);
            first += lanes;
            for (to, answer) in out.iter_mut().zip(&answers) {
                *to = *answer;
                count += u64::from(J::counts(answer));
            }
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
        let size = [self.tiles.columns(), self.tiles.height()];
        let rows = I::Packet::ALL.count_ones() as usize / COLUMNS;
        let mut trust = Trust::default();
        for x in (0..size[0]).step_by(COLUMNS) {
            for y in (0..size[1]).step_by(rows) {
                let at = ([x, y], [COLUMNS, rows]);
                count += self.fill_cell::<I>(at, &mut trust, &mut stack);
            }
        }
        count
    }
}

/// Whether packets of late were worth it.
#[derive(Default)]
struct Trust {
    failed: u32,
    /// Cells that go one by one before the next packet is tried.
    pause: u32,
}

/// The longest pause.
const PAUSE: u32 = 7;

impl Trust {
    #[inline(always)]
    fn tries(&mut self) -> bool {
        let tries = self.pause == 0;
        self.pause = self.pause.saturating_sub(1);
        tries
    }

    #[inline(always)]
    fn saw(&mut self, worth: bool) {
        self.failed = if worth { 0 } else { self.failed + 1 };
        self.pause = ((1 << self.failed.min(8)) - 1).min(PAUSE);
    }
}

impl<J: Job> PictureTask<'_, J> {
    /// Returns how many of the answers count.
    #[inline(always)]
    fn fill_cell<I: Isa>(
        &mut self,
        (at, size): ([usize; 2], [usize; 2]),
        trust: &mut Trust,
        stack: &mut Stack,
    ) -> u64 {
        let cell = Cell::new(&self.tiles, at, size);
        let mut together = None;
        if trust.tries() {
            together = self.job.together::<I>(&cell, stack);
            trust.saw(together.is_some());
        }
        let answers = match together {
            Some(answers) => answers,
            None => one_by_one::<I, J>(self.job, &Few::of(&cell), stack),
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

/// Some rays by their numbers, no more than a packet holds.
struct Few {
    indices: [usize; MOST_RAYS],
    asked: u32,
}

impl Few {
    #[inline(always)]
    fn row(first: usize, count: usize) -> Self {
        let mut indices = [0; MOST_RAYS];
        for (lane, index) in indices.iter_mut().enumerate() {
            *index = first + lane;
        }
        let asked = (1 << count) - 1;
        Self { indices, asked }
    }

    #[inline(always)]
    fn of(cell: &Cell) -> Self {
        let mut indices = [0; MOST_RAYS];
        for (lane, index) in indices.iter_mut().enumerate().take(cell.lanes) {
            *index = cell.index(lane);
        }
        let asked = cell.asked;
        Self { indices, asked }
    }
}

/// Cannot hit anything.
const NO_RAY: Ray = Ray {
    origin: [0.0; 3],
    t_min: 0.0,
    direction: [0.0; 3],
    t_max: 0.0,
};

/// The answers of a few rays, prepared together and traced each on its own.
#[inline(always)]
fn one_by_one<I: Isa, J: Job>(job: &J, few: &Few, stack: &mut Stack) -> [J::Answer; MOST_RAYS] {
    let mut rays = [NO_RAY; MOST_RAYS];
    for (lane, ray) in rays.iter_mut().enumerate() {
        if few.asked >> lane & 1 == 1
            && let Some(asked) = job.ray(few.indices[lane])
        {
            *ray = asked;
        }
    }
    let group = Group::<I::Packet>::new(&rays, job.scale(), &job.tracer().tree.root);
    let mut answers = [J::NONE; MOST_RAYS];
    for (lane, answer) in answers.iter_mut().enumerate() {
        let index = few.indices[lane];
        if group.ready >> lane & 1 == 1 {
            let ray = InGroup {
                group: &group,
                lane,
            };
            *answer = job.prepared::<I>(index, ray, stack);
        } else if few.asked >> lane & 1 == 1 {
            *answer = job.one::<I>(index, stack);
        }
    }
    answers
}
