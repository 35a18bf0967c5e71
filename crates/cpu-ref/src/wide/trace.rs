//! Rays to hits by the wide tree, task by task.

use super::cell::{COLUMNS, Cell};
use super::few::Few;
use super::jobs::{Any, Closest, ClosestAndShadow, Job};
use super::tree::Wide;
use super::trust::Trust;
use crate::packets::{Packets, Sink, fill_list, fill_picture};
use crate::preprocess::Geometry;
use crate::shadow::Light;
use crate::simd::{Isa, Lanes, Work};
use crate::trace::{Answer, Counts, Tracer, ray};
use crate::traverse::Stack;
use backend::Rays;
use geom::{Hit, Point};
use std::sync::atomic::AtomicU64;

/// Rays, and what they are traced through.
#[derive(Clone, Copy)]
pub(crate) struct WideTracer<'a> {
    pub(crate) rays: Rays<'a>,
    pub(crate) tree: &'a Wide,
    pub(crate) geometry: Geometry<'a>,
    /// Counts rays that exact arithmetic settled.
    pub(crate) settled: &'a AtomicU64,
}

impl<'a> WideTracer<'a> {
    /// The same rays, each by itself.
    pub(super) fn singly(self) -> Tracer<'a, &'a Wide> {
        Tracer {
            rays: self.rays,
            tree: self.tree,
            geometry: self.geometry,
            settled: self.settled,
        }
    }

    /// Closest hits, in the rays' order.
    pub(crate) fn closest(self, out: &mut [Hit]) -> Counts {
        self.fill(out, &Closest(self))
    }

    /// 1 for each ray that hits anything.
    pub(crate) fn any(self, out: &mut [u8]) -> Counts {
        self.fill(out, &Any(self))
    }

    /// Closest hits, and 1 for each that the light does not reach.
    pub(crate) fn closest_and_shadow(self, light: Point, out: (&mut [Hit], &mut [u8])) -> Counts {
        let light = Light::new(light, &self.geometry, &self.tree.root);
        let job = ClosestAndShadow {
            tracer: self,
            light,
        };
        self.fill(out, &job)
    }

    /// Whether any of some neighbours in a list is extreme.
    #[inline(always)]
    fn has_extreme(&self, first: usize, count: usize) -> bool {
        let rays = first..first + count;
        rays.into_iter()
            .any(|i| self.geometry.is_extreme(&ray(self.rays, i)))
    }

    fn fill<O, J>(&self, out: O, job: &J) -> Counts
    where
        O: Sink<Entry = J::Answer>,
        J: Job,
    {
        let level = self.tree.level;
        match self.rays {
            Rays::Camera(camera) if out.size() > 0 => {
                fill_picture(out, camera.width as usize, |packets| {
                    level.run(PictureTask { packets, job })
                })
            }
            _ => fill_list(out, |first, out| level.run(ListTask { first, out, job })),
        }
    }
}

struct ListTask<'a, O, J> {
    first: usize,
    out: O,
    job: &'a J,
}

impl<J: Job, O: Sink<Entry = J::Answer>> Work for ListTask<'_, O, J> {
    type Out = Counts;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> Counts {
        let (mut stack, mut sum) = (Stack::new(), Counts::default());
        let lanes = I::Packet::ALL.count_ones() as usize;
        for begin in (0..self.out.size()).step_by(lanes) {
            let count = lanes.min(self.out.size() - begin);
            let few = Few::row(self.first + begin, count);
            let answers = match self.job.tracer().has_extreme(self.first + begin, count) {
                true => self.job.singly(&few, &mut stack),
                false => self.job.few::<I>(&few, &mut stack),
            };
            for (lane, answer) in answers.iter().enumerate().take(count) {
                sum = sum + answer.counts();
                self.out.set(begin + lane, *answer);
            }
        }
        sum
    }
}

struct PictureTask<'a, O, J> {
    packets: Packets<O>,
    job: &'a J,
}

impl<J: Job, O: Sink<Entry = J::Answer>> Work for PictureTask<'_, O, J> {
    type Out = Counts;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> Counts {
        let (mut stack, mut sum) = (Stack::new(), Counts::default());
        let size = [self.packets.columns(), self.packets.height()];
        let rows = I::Packet::ALL.count_ones() as usize / COLUMNS;
        let mut trust = Trust::default();
        for x in (0..size[0]).step_by(COLUMNS) {
            for y in (0..size[1]).step_by(rows) {
                let cell = Cell::new(&self.packets, [x, y], [COLUMNS, rows]);
                let answers = self.job.cell::<I>(&cell, &mut trust, &mut stack);
                sum = sum + self.write(&cell, [x, y], &answers);
            }
        }
        sum
    }
}

impl<J: Job, O: Sink<Entry = J::Answer>> PictureTask<'_, O, J> {
    /// Writes the answers of the cell at `at`, and counts them.
    #[inline(always)]
    fn write(&mut self, cell: &Cell, at: [usize; 2], answers: &[J::Answer]) -> Counts {
        let mut sum = Counts::default();
        for (lane, answer) in answers.iter().enumerate() {
            if cell.asked >> lane & 1 == 1 {
                sum = sum + answer.counts();
                let (x, y) = (at[0] + lane % COLUMNS, at[1] + lane / COLUMNS);
                self.packets.set(x, y, *answer);
            }
        }
        sum
    }
}
