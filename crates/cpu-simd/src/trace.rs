//! Rays to hits by the wide tree: rays of neighbouring pixels together where that pays, others each on its own.

use crate::cell::{COLUMNS, Cell};
use crate::light::{Found, shadow_rays};
use crate::packet::Packet;
use crate::rays::{Given, Group, OneRay};
use crate::search;
use crate::simd::{Isa, Lanes, Work, each};
use crate::together::{self, MOST_RAYS, NONE};
use crate::tree::{NOWHERE, Wide};
use crate::walk::walk_any;
use backend::{QueryKind, Rays};
use cpu_ref::intersect::{Search, Watertight};
use cpu_ref::scale::Scale;
use cpu_ref::tiles::{Counts, Output, Tiles, fill};
use cpu_ref::trace::Tracer;
use cpu_ref::traverse;
use geom::{Camera, Hit, Ray};

type PacketOf<I> = Packet<<I as Isa>::Packet, <I as Isa>::Planes>;
type Stack<'a> = traverse::Stack<&'a Wide>;

/// A tracer by the watertight test in vectors.
pub(crate) struct WideTracer<'a>(pub(crate) Tracer<'a, &'a Wide>);

impl<'a> WideTracer<'a> {
    /// Answers all rays, in their order.
    pub(crate) fn trace(&self, out: Output<'_>) -> Counts {
        let (level, tracer) = (self.0.tree.level, self);
        let list = |first, out: Output<'_>| level.run(ListTask { first, out, tracer });
        fill(self.0.task.query.rays, out, list, |tiles| {
            level.run(PictureTask { tiles, tracer })
        })
    }

    /// The answers for the rays of a cell, one a lane.
    #[inline(always)]
    fn answers<I: Isa>(&self, cell: &Cell, trust: &mut Trust, stack: &mut Stack<'a>) -> Found {
        let Tracer { task, tree, light } = &self.0;
        let together = self.together::<I>(cell, trust, stack);
        let (mut found, rays, scale);
        let (mut asked, mut skipped) = (cell.asked, NONE);
        if task.query.kind == QueryKind::Any {
            if let Some(found) = together {
                return found;
            }
            found = Found::NOTHING;
            rays = Given::<I::Packet>::of(&cell.rays(task));
            scale = task.geometry.scale;
        } else {
            found = match together {
                Some(found) => found,
                None => self.closest_each::<I>(cell, stack),
            };
            let Some(light) = light else {
                return found;
            };
            asked &= found.lanes();
            if asked == 0 {
                return found;
            }
            // At once, while all that the rays came to is in the nearest caches.
            let corners = found.corners::<I>(&task.geometry, tree);
            let eyes = self.eyes::<I>(cell);
            rays = shadow_rays(light, &corners, found.weights::<I>(), &eyes);
            scale = Scale::ONE;
            for (skipped, hit) in skipped.iter_mut().zip(&found.hits) {
                *skipped = hit.triangle;
            }
        }
        found.blocked = self.any_each::<I>((&rays, scale), (asked, &skipped), stack);
        found
    }

    /// Where rays start, in scaled units.
    #[inline(always)]
    fn eyes<I: Isa>(&self, cell: &Cell) -> [I::Packet; 3] {
        let task = &self.0.task;
        if let Rays::Camera(camera) = task.query.rays {
            let eye = task.geometry.scale.apply(camera.eye);
            return each!(i => I::Packet::splat(eye[i]));
        }
        Given::of(&cell.rays(task)).scaled_origin(task.geometry.scale)
    }

    /// What a cell's rays find as a packet; `None` where they go better one by one.
    #[inline(always)]
    fn together<I: Isa>(
        &self,
        cell: &Cell,
        trust: &mut Trust,
        stack: &mut Stack<'a>,
    ) -> Option<Found> {
        let Rays::Camera(camera) = self.0.task.query.rays else {
            return None;
        };
        if !trust.tries() {
            return None;
        }
        let found = self.packet::<I>(camera, cell, stack);
        trust.saw(found.is_some());
        found
    }

    #[inline(always)]
    fn packet<I: Isa>(&self, camera: &Camera, cell: &Cell, stack: &mut Stack<'a>) -> Option<Found> {
        let (stack, tree) = (&mut stack.waiting, self.0.tree);
        let (packet, back) = self.camera_packet::<I>(camera, cell)?;
        if self.0.task.query.kind == QueryKind::Any {
            let blocked = together::any::<I>(tree, &packet, (cell.asked, &NONE), stack)?;
            let nothing = Found::NOTHING;
            return Some(Found { blocked, ..nothing });
        }
        let found = together::closest::<I>(tree, &packet, stack)?;
        Some(self.unpack::<I>(&found, back))
    }

    /// Hits of a packet, whose distances `back` brings to units of the camera's directions.
    #[inline(always)]
    fn unpack<I: Isa>(&self, packet: &together::Found<I::Packet>, back: I::Packet) -> Found {
        let t = packet.t.mul(back).store();
        let (u, v) = (packet.u.store(), packet.v.store());
        let mut found = Found::NOTHING;
        for (lane, &t) in t.as_ref().iter().enumerate() {
            let place = packet.places[lane];
            if place != NOWHERE {
                let (u, v) = (u.as_ref()[lane], v.as_ref()[lane]);
                let triangle = self.0.tree.triangle_at(place);
                found.hits[lane] = Hit { t, u, v, triangle };
            }
        }
        found.places = packet.places;
        found
    }

    /// The rays of a cell's pixels; and what brings their distances to units of the camera's directions.
    #[inline(always)]
    fn camera_packet<I: Isa>(
        &self,
        camera: &Camera,
        cell: &Cell,
    ) -> Option<(PacketOf<I>, I::Packet)> {
        let scale = self.0.task.geometry.scale;
        let eye = scale.apply(camera.eye);
        let origin = each!(i => I::Packet::splat(eye[i]));
        let directions = cell.directions::<I::Packet>(camera);
        let packet = Packet::new(&origin, &directions, &self.0.tree.root)?;
        let back = I::Packet::splat(scale.usual_inverse()?);
        let back = packet.factor.mul(back);
        Some((packet, back))
    }

    /// Closest hits of rays that are prepared together and traced each on its own.
    #[inline(always)]
    fn closest_each<I: Isa>(&self, cell: &Cell, stack: &mut Stack<'a>) -> Found {
        let (scale, tree) = (self.0.task.geometry.scale, self.0.tree);
        let rays = cell.rays(&self.0.task);
        let group = Group::<I::Packet>::new(&Given::of(&rays), scale, &tree.root);
        let mut found = Found::NOTHING;
        for (lane, alone) in rays.iter().enumerate() {
            if (group.ready & cell.asked) >> lane & 1 == 1 {
                let group = &group;
                let ray = OneRay { group, lane };
                let best = search::closest::<I>(tree, &ray, &mut stack.waiting);
                if best.hit.is_hit() {
                    let t = ray.unscaled(best.hit.t);
                    found.hits[lane] = Hit { t, ..best.hit };
                    found.places[lane] = best.place;
                }
            } else if cell.asked >> lane & 1 == 1 {
                found.hits[lane] = self.closest_unusual(alone, scale, stack);
            }
        }
        found
    }

    /// Which rays of `asked` hit any triangle but those left out.
    #[inline(always)]
    fn any_each<I: Isa>(
        &self,
        (rays, scale): (&Given<I::Packet>, Scale),
        (asked, skipped): (u32, &[u32; MOST_RAYS]),
        stack: &mut Stack<'a>,
    ) -> u32 {
        let tree = self.0.tree;
        let group = Group::<I::Packet>::new(rays, scale, &tree.root);
        let mut hit = 0;
        for (lane, &skipped) in skipped.iter().enumerate() {
            if (group.ready & asked) >> lane & 1 == 1 {
                let group = &group;
                let ray = OneRay { group, lane };
                let found = walk_any::<I>(tree, &ray, skipped, &mut stack.waiting);
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
    fn closest_unusual(&self, ray: &Ray, scale: Scale, stack: &mut Stack<'a>) -> Hit {
        let hit = Watertight::closest(&self.0.asked(*ray, scale), stack);
        hit.unwrap_or(Hit::MISS)
    }

    /// Whether an unusual ray hits any triangle but `skipped`.
    #[cold]
    #[inline(never)]
    fn any_unusual(&self, ray: &Ray, scale: Scale, skipped: u32, stack: &mut Stack<'a>) -> bool {
        Watertight::any(&self.0.asked(*ray, scale), Some(skipped), stack)
    }

    /// The answers for the rays of a cell, some of which are extreme.
    #[cold]
    #[inline(never)]
    fn singly(&self, cell: &Cell, stack: &mut Stack<'a>) -> Found {
        let mut found = Found::NOTHING;
        for lane in 0..cell.asked.count_ones() as usize {
            let (hit, blocked) = self.0.answer::<Watertight>(cell.index(lane), stack);
            found.hits[lane] = hit;
            found.blocked |= u32::from(blocked) << lane;
        }
        found
    }
}

struct ListTask<'a, 'o> {
    first: usize,
    out: Output<'o>,
    tracer: &'a WideTracer<'a>,
}

impl Work for ListTask<'_, '_> {
    type Out = Counts;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> Counts {
        let (mut stack, mut sum) = (Stack::default(), Counts::default());
        let (tracer, lanes) = (self.tracer, I::Packet::ALL.count_ones() as usize);
        let geometry = &tracer.0.task.geometry;
        for begin in (0..self.out.count()).step_by(lanes) {
            let count = lanes.min(self.out.count() - begin);
            let first = self.first + begin;
            let cell = Cell::row(first, count);
            let mut extreme = false;
            for index in first..first + count {
                extreme |= geometry.is_extreme(&tracer.0.task.ray(index));
            }
            let found = if extreme {
                tracer.singly(&cell, &mut stack)
            } else {
                tracer.answers::<I>(&cell, &mut Trust::default(), &mut stack)
            };
            for lane in 0..count {
                self.out.set(begin + lane, found.answer(lane));
            }
            sum = sum + found.counts(cell.asked);
        }
        sum
    }
}

struct PictureTask<'a, 'o> {
    tiles: Tiles<'o>,
    tracer: &'a WideTracer<'a>,
}

impl Work for PictureTask<'_, '_> {
    type Out = Counts;

    #[inline(always)]
    fn run<I: Isa>(mut self) -> Counts {
        let (mut stack, mut sum) = (Stack::default(), Counts::default());
        let size = [self.tiles.columns(), self.tiles.height()];
        let rows = I::Packet::ALL.count_ones() as usize / COLUMNS;
        let mut trust = Trust::default();
        for x in (0..size[0]).step_by(COLUMNS) {
            for y in (0..size[1]).step_by(rows) {
                let cell = Cell::new(&self.tiles, [x, y], rows);
                let found = self.tracer.answers::<I>(&cell, &mut trust, &mut stack);
                self.write(&cell, [x, y], &found);
                sum = sum + found.counts(cell.asked);
            }
        }
        sum
    }
}

impl PictureTask<'_, '_> {
    /// Writes the answers of the cell at `at`.
    #[inline(always)]
    fn write(&mut self, cell: &Cell, at: [usize; 2], found: &Found) {
        for lane in 0..MOST_RAYS {
            if cell.asked >> lane & 1 == 1 {
                let (x, y) = (at[0] + lane % COLUMNS, at[1] + lane / COLUMNS);
                self.tiles.set(x, y, found.answer(lane));
            }
        }
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
