//! Tracing through the wide tree: neighbouring rays as packets where that is faster, other rays singly.

use crate::intersect::{Intersect, Touch};
use crate::light::{Found, shadow_rays};
use crate::packet::{self, NONE, Packet};
use crate::rays::{COLUMNS, Cell, Given, Group, MOST_RAYS, OneRay};
use crate::simd::{Isa, Lanes, Outlined, Vector, Work};
use crate::tree::{NOWHERE, Wide};
use crate::walk;
use backend::{QueryKind, Rays};
use cpu_ref::intersect::{Exact, Search};
use cpu_ref::scale::Scale;
use cpu_ref::tiles::{Counts, Output, Tiles, fill};
use cpu_ref::trace::Tracer;
use cpu_ref::traverse;
use geom::{Camera, Hit, Ray};
use std::marker::PhantomData;
use std::ops::Range;

type PacketOf<I> = Packet<<I as Isa>::Packet, <I as Isa>::Planes>;
type Stack<'a> = traverse::Stack<&'a Wide>;

/// A tracer for an intersector in vectors.
pub(crate) struct WideTracer<'a, T> {
    tracer: Tracer<'a, &'a Wide>,
    intersector: PhantomData<T>,
}

impl<'a, T: Intersect> WideTracer<'a, T> {
    pub(crate) fn new(tracer: Tracer<'a, &'a Wide>) -> Self {
        Self {
            tracer,
            intersector: PhantomData,
        }
    }

    /// Traces all rays and writes the answers in their order.
    pub(crate) fn trace(&self, out: Output<'_>) -> Counts {
        fill(self.tracer.task.query.rays, out, |tiles| {
            let tracer = self;
            self.tracer.tree.level.run(TilesTask { tiles, tracer })
        })
    }

    /// Converts the hits of a packet. `back` is the factor from its distances to units of the given directions.
    #[inline(always)]
    fn unpack<I: Isa>(&self, packet: &packet::Found<I::Packet>, back: I::Packet) -> Found {
        let t = packet.t.mul(back).store();
        let (u, v) = (packet.u.store(), packet.v.store());
        let mut found = Found::NOTHING;
        for (lane, &t) in t.as_ref().iter().enumerate() {
            let place = packet.places[lane];
            if place != NOWHERE {
                let (u, v) = (u.as_ref()[lane], v.as_ref()[lane]);
                let triangle = self.tracer.tree.triangle_at(place);
                found.hits[lane] = Hit { t, u, v, triangle };
            }
        }
        found.places = packet.places;
        found
    }

    /// Returns the closest hits of rays that are prepared together: traced as a packet where that is faster, else
    /// singly.
    #[inline(always)]
    fn closest<I: Isa>(
        &self,
        rays: &Given<I::Packet>,
        asked: u32,
        State { stack, closest, .. }: &mut State<'a>,
    ) -> Found {
        let (scale, tree) = (self.tracer.task.geometry.scale, self.tracer.tree);
        let group = Group::<I::Packet>::new(rays, scale, &tree.root);
        let packet = closest.packet::<I>(&group, tree);
        if let Some(packet) = packet {
            let found = T::closest_together::<I>(tree, &packet, &mut stack.waiting);
            closest.saw(found.is_some());
            if let Some(packet) = found {
                let mut found = self.unpack::<I>(&packet, I::Packet::load(&group.back));
                if T::IS_EXACT {
                    self.report(&rays.rays(), (asked, packet.open), &mut found, stack);
                }
                return found;
            }
        }
        let (mut found, mut open) = (Found::NOTHING, 0);
        for lane in 0..MOST_RAYS {
            if (group.ready & asked) >> lane & 1 == 1 {
                let group = &group;
                let ray = OneRay { group, lane };
                let best = T::closest_alone::<I>(tree, &ray, &mut stack.waiting);
                open |= u32::from(best.is_open) << lane;
                found.places[lane] = best.place;
                if best.hit.is_hit() {
                    let t = ray.unscaled(best.hit.t);
                    found.hits[lane] = Hit { t, ..best.hit };
                }
            } else if asked >> lane & 1 == 1 {
                found.hits[lane] = self.closest_unusual(&rays.ray(lane), scale, stack);
            }
        }
        if T::IS_EXACT {
            self.report(&rays.rays(), (asked & group.ready, open), &mut found, stack);
        }
        found
    }

    /// Has the reference report the exact hits of the lanes of `asked`. It traces the rays of `open` lanes again.
    #[inline(never)]
    fn report(
        &self,
        rays: &[Ray; MOST_RAYS],
        (asked, open): (u32, u32),
        found: &mut Found,
        stack: &mut Stack<'a>,
    ) {
        let scale = self.tracer.task.geometry.scale;
        for (lane, ray) in rays.iter().enumerate() {
            let place = found.places[lane];
            if asked >> lane & 1 == 0 {
                continue;
            }
            if open >> lane & 1 == 1 {
                found.hits[lane] = self.closest_unusual(ray, scale, stack);
                found.places[lane] = NOWHERE;
            } else if place != NOWHERE {
                let asked = self.tracer.asked(*ray, scale);
                let hit = Exact::sure_hit(&asked, place as usize);
                found.hits[lane] = hit.unwrap_or(Hit::MISS);
            }
        }
    }

    /// Returns the rays of `asked` that hit any triangle except the skipped ones. Traces them as a packet or singly.
    #[inline(always)]
    fn any<I: Isa>(
        &self,
        (rays, scale): (&Given<I::Packet>, Scale),
        (asked, skipped): (u32, &[u32; MOST_RAYS]),
        State { stack, any, .. }: &mut State<'a>,
    ) -> u32 {
        let tree = self.tracer.tree;
        let group = Group::<I::Packet>::new(rays, scale, &tree.root);
        let all = asked == I::Packet::ALL;
        let packet = if all {
            any.packet::<I>(&group, tree)
        } else {
            None
        };
        if let Some(packet) = packet {
            let found = packet::any::<I, T>(tree, &packet, (asked, skipped), &mut stack.waiting);
            any.saw(found.is_some());
            if let Some(touch) = found {
                return self.settle_any((rays, scale), touch, skipped, stack);
            }
        }
        let (mut hit, mut open) = (0, 0);
        for (lane, &skipped) in skipped.iter().enumerate() {
            if (group.ready & asked) >> lane & 1 == 1 {
                let group = &group;
                let ray = OneRay { group, lane };
                let touch = walk::any::<I, T>(tree, &ray, skipped, &mut stack.waiting);
                hit |= touch.hit << lane;
                open |= touch.open << lane;
            } else if asked >> lane & 1 == 1 {
                let found = self.any_unusual(&rays.ray(lane), scale, skipped, stack);
                hit |= u32::from(found) << lane;
            }
        }
        self.settle_any((rays, scale), Touch { hit, open }, skipped, stack)
    }

    /// Returns the lanes that hit anything. The reference traces the rays of open lanes again.
    #[inline(always)]
    fn settle_any<L: Lanes>(
        &self,
        (rays, scale): (&Given<L>, Scale),
        touch: Touch,
        skipped: &[u32; MOST_RAYS],
        stack: &mut Stack<'a>,
    ) -> u32 {
        let (mut hit, mut open) = (touch.hit, touch.open);
        while open != 0 {
            let lane = open.trailing_zeros() as usize % MOST_RAYS;
            open &= open - 1;
            let found = self.any_unusual(&rays.ray(lane), scale, skipped[lane], stack);
            hit |= u32::from(found) << lane;
        }
        hit
    }

    /// Returns the closest hit of a ray that vectors do not answer.
    #[cold]
    #[inline(never)]
    fn closest_unusual(&self, ray: &Ray, scale: Scale, stack: &mut Stack<'a>) -> Hit {
        let hit = T::Reference::closest(&self.tracer.asked(*ray, scale), stack);
        hit.unwrap_or(Hit::MISS)
    }

    /// Returns whether a ray that vectors do not answer hits any triangle except `skipped`.
    #[cold]
    #[inline(never)]
    fn any_unusual(&self, ray: &Ray, scale: Scale, skipped: u32, stack: &mut Stack<'a>) -> bool {
        T::Reference::any(&self.tracer.asked(*ray, scale), Some(skipped), stack)
    }

    /// Answers rays of a list one by one, because some are extreme.
    #[cold]
    #[inline(never)]
    fn singly(&self, indices: Range<usize>, stack: &mut Stack<'a>) -> Found {
        let mut found = Found::NOTHING;
        for (lane, index) in indices.enumerate() {
            let (hit, blocked) = self.tracer.answer::<T::Reference>(index, stack);
            found.hits[lane] = hit;
            found.blocked |= u32::from(blocked) << lane;
        }
        found
    }
}

/// State of a task that persists from packet to packet.
#[derive(Default)]
struct State<'a> {
    stack: Stack<'a>,
    /// History of packets in closest-hit searches.
    closest: Trust,
    /// History of packets in any-hit searches.
    any: Trust,
}

struct TilesTask<'a, 'o, T> {
    tiles: Tiles<'o>,
    tracer: &'a WideTracer<'a, T>,
}

impl<T: Intersect> Work for TilesTask<'_, '_, T> {
    type Out = Counts;

    #[inline(always)]
    fn run<I: Isa>(self) -> Counts {
        match self.tracer.tracer.task.query.rays {
            Rays::Camera(camera) => self.picture::<I>(camera),
            Rays::List(list) => self.list::<I>(list),
            Rays::OnDevice(_) => Counts::default(),
        }
    }
}

impl<T: Intersect> TilesTask<'_, '_, T> {
    #[inline(always)]
    fn list<I: Isa>(mut self, list: &[Ray]) -> Counts {
        let (mut state, mut sum) = (State::default(), Counts::default());
        let (tracer, lanes) = (self.tracer, I::Packet::ALL.count_ones() as usize);
        let first = self.tiles.index(0, 0);
        let list = &list[first..first + self.tiles.columns()];
        for (i, rays) in list.chunks(lanes).enumerate() {
            let (begin, asked) = (i * lanes, (1 << rays.len()) - 1);
            let given = Given::listed(rays);
            let geometry = &tracer.tracer.task.geometry;
            let found = if given.extreme(geometry) & asked != 0 {
                let indices = first + begin..first + begin + rays.len();
                tracer.singly(indices, &mut state.stack)
            } else {
                I::outlined(Answers {
                    tracer,
                    rays: &given,
                    asked,
                    state: &mut state,
                })
            };
            for lane in 0..rays.len() {
                self.tiles.set(begin + lane, 0, found.answer(lane));
            }
            sum = sum + found.counts(asked);
        }
        sum
    }

    #[inline(always)]
    fn picture<I: Isa>(mut self, camera: &Camera) -> Counts {
        let (mut state, mut sum) = (State::default(), Counts::default());
        let size = [self.tiles.columns(), self.tiles.height()];
        let rows = I::Packet::ALL.count_ones() as usize / COLUMNS;
        for x in (0..size[0]).step_by(COLUMNS) {
            for y in (0..size[1]).step_by(rows) {
                let cell = Cell::new(&self.tiles, [x, y], rows);
                let found = I::outlined(Answers {
                    tracer: self.tracer,
                    rays: &cell.rays(camera),
                    asked: cell.asked,
                    state: &mut state,
                });
                self.write(&cell, [x, y], &found);
                sum = sum + found.counts(cell.asked);
            }
        }
        sum
    }

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

/// Answers the rays in the lanes of `asked`. Lists and pictures share this part, because it takes long to compile.
struct Answers<'a, 't, L, T> {
    tracer: &'t WideTracer<'a, T>,
    rays: &'t Given<L>,
    asked: u32,
    state: &'t mut State<'a>,
}

impl<I: Isa, T: Intersect> Outlined<I> for Answers<'_, '_, I::Packet, T> {
    type Out = Found;

    #[inline(always)]
    fn run(self) -> Found {
        let Self {
            tracer,
            rays,
            asked,
            state,
        } = self;
        let Tracer { task, tree, light } = &tracer.tracer;
        let scale = task.geometry.scale;
        let mut found = Found::NOTHING;
        if task.query.kind == QueryKind::Any {
            found.blocked = tracer.any::<I>((rays, scale), (asked, &NONE), state);
            return found;
        }
        found = tracer.closest::<I>(rays, asked, state);
        let (Some(light), hit) = (light, asked & found.lanes()) else {
            return found;
        };
        if hit == 0 {
            return found;
        }
        // Shadow rays are traced now, while the results of the rays are in the nearest caches.
        let corners = found.corners::<I>(&task.geometry, tree);
        let eyes = rays.scaled_origin(scale);
        let shadows = shadow_rays(light, &corners, found.weights::<I>(), &eyes);
        let mut skipped = NONE;
        for (skipped, hit) in skipped.iter_mut().zip(&found.hits) {
            *skipped = hit.triangle;
        }
        found.blocked = tracer.any::<I>((&shadows, Scale::ONE), (hit, &skipped), state);
        found
    }
}

/// History of whether packets were faster than single rays.
#[derive(Default)]
struct Trust {
    failed: u32,
    /// Cells to trace singly before the next packet is tried.
    pause: u32,
}

/// The longest pause, in cells.
const PAUSE: u32 = 7;

impl Trust {
    /// Creates a packet of a group's rays, unless a pause lasts or the tree is `spread`: packets pad boxes by the size
    /// of the whole tree.
    #[inline(always)]
    fn packet<I: Isa>(&mut self, group: &Group<I::Packet>, tree: &Wide) -> Option<PacketOf<I>> {
        let tries = self.pause == 0 && !tree.spread;
        self.pause = self.pause.saturating_sub(1);
        if tries { Packet::of(group) } else { None }
    }

    #[inline(always)]
    fn saw(&mut self, worth: bool) {
        self.failed = if worth { 0 } else { self.failed + 1 };
        self.pause = ((1 << self.failed.min(8)) - 1).min(PAUSE);
    }
}
