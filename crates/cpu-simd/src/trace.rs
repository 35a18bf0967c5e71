//! Traces the rays of a query through the wide tree: neighbouring rays as packets if that is faster, other rays singly.

use crate::exact::ExactFilter;
use crate::intersect::AnyHits;
use crate::light::{LaneAnswers, shadow_rays};
use crate::packet::{self, NONE_SKIPPED, PacketHits, RayPacket};
use crate::rays::{COLUMNS, Cell, InputRays, MOST_RAYS, OneRay, PreparedRays};
use crate::search::ClosestSearch;
use crate::simd::{Isa, Lanes, Outlined, PlaneVector, SetLanes, VectorWork, each};
use crate::single;
use crate::tiles::{Tiles, fill};
use crate::tree::{Bvh8, NOWHERE};
use crate::walk::TraversalStack;
use backend::{Intersector, QueryKind, Rays};
use cpu_ref::intersect::{MollerTrumbore, Watertight, Woop};
use cpu_ref::scale::Scale;
use cpu_ref::{Geometry, HitCounts, QueryTracer, TraceOutput, is_extreme};
use geom::{Camera, CoordinateRange, Hit, Ray};
use std::marker::PhantomData;
use std::ops;

type PacketOf<I> = RayPacket<<I as Isa>::Packet, <I as Isa>::Planes>;

/// Traces all rays and writes the answers in their order.
pub(crate) fn trace(tracer: &QueryTracer<'_>, tree: &Bvh8, out: TraceOutput<'_>) -> HitCounts {
    let is_extreme = match tracer.query.rays {
        Rays::Camera(camera) => is_extreme(&tracer.geometry, camera.eye),
        Rays::List(_) | Rays::OnDevice(_) => tracer.geometry.range.extreme,
    };
    match tracer.intersector {
        _ if is_extreme => tracer.trace(out),
        Intersector::MollerTrumbore => WideTracer::<MollerTrumbore>::new(tracer, tree).trace(out),
        Intersector::Woop => WideTracer::<Woop>::new(tracer, tree).trace(out),
        Intersector::Watertight => WideTracer::<Watertight>::new(tracer, tree).trace(out),
        Intersector::Exact => WideTracer::<ExactFilter>::new(tracer, tree).trace(out),
    }
}

/// Returns the lanes whose rays are extreme, as [`geom::CoordinateRange::is_extreme`] does.
/// [`geom::CoordinateRange::extreme`] must be false.
#[inline(always)]
fn extreme_lanes<L: Lanes>(rays: &InputRays<L>, geometry: &Geometry<'_>) -> u32 {
    let origin = rays.scaled_origin(geometry.scale);
    let [x, y, z] = each!(i => origin[i].abs());
    let size = x.max(y).max(z);
    let not_nan = x.add(y).add(z).at_most(L::splat(f32::INFINITY));
    let usual = L::bits(L::both(not_nan, size.less(L::splat(CoordinateRange::FAR))));
    let near = L::bits(size.less(L::splat(CoordinateRange::NEAR)));
    !usual | if geometry.range.tiny { near } else { 0 }
}

/// Traces a query with intersector `T` in vector code.
struct WideTracer<'a, T> {
    tracer: &'a QueryTracer<'a>,
    tree: &'a Bvh8,
    intersector: PhantomData<T>,
}

/// Rays that are traced together.
struct LaneBatch<'a, L> {
    rays: &'a InputRays<L>,
    /// Conversion from the rays' units to scaled units.
    scale: Scale,
    /// Lanes whose rays are traced.
    active: u32,
}

impl<'a, T: ClosestSearch> WideTracer<'a, T> {
    fn new(tracer: &'a QueryTracer<'a>, tree: &'a Bvh8) -> Self {
        Self {
            tracer,
            tree,
            intersector: PhantomData,
        }
    }

    /// Traces all rays and writes the answers in their order.
    fn trace(&self, out: TraceOutput<'_>) -> HitCounts {
        fill(self.tracer.query.rays, out, |tiles| {
            let tracer = self;
            self.tree.instruction_set.run(TilesTask { tiles, tracer })
        })
    }

    /// Converts the hits of a packet. `back` is the factor from the packet's distances to units of the caller's rays.
    #[inline(always)]
    fn unpack<I: Isa>(&self, hits: &PacketHits<I::Packet>, back: I::Packet) -> LaneAnswers {
        // If a negative `t` underflows, it becomes +0, as for single rays.
        let t = hits.t.mul(back).add(I::Packet::splat(0.0)).store();
        let (u, v) = (hits.u.store(), hits.v.store());
        let mut answers = LaneAnswers::NOTHING;
        for (lane, &t) in t.as_ref().iter().enumerate() {
            let place = hits.places[lane];
            if place != NOWHERE {
                let (u, v) = (u.as_ref()[lane], v.as_ref()[lane]);
                let triangle = self.tree.triangle_at(place);
                answers.hits[lane] = Hit { t, u, v, triangle };
            }
        }
        answers.places = hits.places;
        answers
    }

    /// Returns the closest hits of a batch. Traces it as a packet if that is likely to be faster, otherwise ray by ray.
    #[inline(always)]
    fn closest<I: Isa>(
        &self,
        batch: &LaneBatch<'_, I::Packet>,
        TaskState { stack, closest, .. }: &mut TaskState,
    ) -> LaneAnswers {
        let (rays, active, tree) = (batch.rays, batch.active, self.tree);
        let group = PreparedRays::<I::Packet>::new(rays, batch.scale, &tree.root);
        let packet = closest.packet::<I>(&group, tree);
        if let Some(packet) = packet {
            let hits = T::closest_of_packet::<I>(tree, &packet, stack);
            closest.record(hits.is_some());
            if let Some(hits) = hits {
                let mut answers = self.unpack::<I>(&hits, I::Packet::load(&group.back));
                if T::IS_FILTER {
                    self.compute_filtered_hits(&rays.rays(), active, hits.open, &mut answers);
                }
                return answers;
            }
        }
        let (mut answers, mut open) = (LaneAnswers::NOTHING, 0);
        for lane in SetLanes::<MOST_RAYS>(active) {
            if group.ready >> lane & 1 == 1 {
                let group = &group;
                let ray = OneRay { group, lane };
                let best = T::closest_of_ray::<I>(tree, &ray, stack);
                open |= u32::from(best.is_open) << lane;
                answers.places[lane] = best.place;
                if best.hit.is_hit() {
                    let t = ray.unscaled(best.hit.t);
                    answers.hits[lane] = Hit { t, ..best.hit };
                }
            } else {
                answers.hits[lane] = self.closest_unusual(&rays.ray(lane));
            }
        }
        if T::IS_FILTER {
            self.compute_filtered_hits(&rays.rays(), active & group.ready, open, &mut answers);
        }
        answers
    }

    /// Computes the hits of a [filter](ClosestSearch::IS_FILTER) with `cpu-ref`, in the active lanes. The filter cannot
    /// decide open lanes, so their rays are traced again.
    #[inline(never)]
    fn compute_filtered_hits(
        &self,
        rays: &[Ray; MOST_RAYS],
        active: u32,
        open: u32,
        answers: &mut LaneAnswers,
    ) {
        for lane in SetLanes::<MOST_RAYS>(active) {
            let (ray, place) = (&rays[lane], answers.places[lane]);
            if open >> lane & 1 == 1 {
                answers.hits[lane] = self.closest_unusual(ray);
                answers.places[lane] = NOWHERE;
            } else if place != NOWHERE {
                let search = self.tracer.search(*ray, self.tracer.geometry.scale);
                let hit = search.certain_hit(self.tree.triangle_at(place));
                answers.hits[lane] = hit.unwrap_or(Hit::MISS);
            }
        }
    }

    /// Returns the active lanes that hit any triangle except the lane's skipped one. Traces a packet or ray by ray.
    #[inline(always)]
    fn any<I: Isa>(
        &self,
        batch: &LaneBatch<'_, I::Packet>,
        skipped: &[u32; MOST_RAYS],
        TaskState { stack, any, .. }: &mut TaskState,
    ) -> u32 {
        let (rays, active, tree) = (batch.rays, batch.active, self.tree);
        let group = PreparedRays::<I::Packet>::new(rays, batch.scale, &tree.root);
        let packet = if active == I::Packet::ALL {
            any.packet::<I>(&group, tree)
        } else {
            None
        };
        if let Some(packet) = packet {
            let found = packet::any::<I, T>(tree, &packet, active, skipped, stack);
            any.record(found.is_some());
            if let Some(hits) = found {
                return self.decide(batch, hits, skipped);
            }
        }
        let mut all = AnyHits::default();
        for lane in SetLanes::<MOST_RAYS>(active) {
            if group.ready >> lane & 1 == 1 {
                let group = &group;
                let ray = OneRay { group, lane };
                let hits = single::any::<I, T>(tree, &ray, skipped[lane], stack);
                all.hit |= hits.hit << lane;
                all.open |= hits.open << lane;
            } else {
                let hit = self.any_unusual(&rays.ray(lane), batch.scale, skipped[lane]);
                all.hit |= u32::from(hit) << lane;
            }
        }
        self.decide(batch, all, skipped)
    }

    /// Returns the lanes that hit anything. Traces the rays of open lanes again with `cpu-ref`.
    #[inline(always)]
    fn decide<L: Lanes>(
        &self,
        batch: &LaneBatch<'_, L>,
        hits: AnyHits,
        skipped: &[u32; MOST_RAYS],
    ) -> u32 {
        let mut hit = hits.hit;
        for lane in SetLanes::<MOST_RAYS>(hits.open) {
            let found = self.any_unusual(&batch.rays.ray(lane), batch.scale, skipped[lane]);
            hit |= u32::from(found) << lane;
        }
        hit
    }

    /// Returns the closest hit of one ray. Uses `cpu-ref`, for rays that the vector code does not support or decide.
    #[cold]
    #[inline(never)]
    fn closest_unusual(&self, ray: &Ray) -> Hit {
        let search = self.tracer.search(*ray, self.tracer.geometry.scale);
        search.closest().unwrap_or(Hit::MISS)
    }

    /// Returns whether one ray hits any triangle except `skipped`. Uses `cpu-ref`, as in [`Self::closest_unusual`].
    #[cold]
    #[inline(never)]
    fn any_unusual(&self, ray: &Ray, scale: Scale, skipped: u32) -> bool {
        self.tracer.search(*ray, scale).any(Some(skipped))
    }

    /// Traces rays of a list one by one with `cpu-ref`, because some are extreme.
    #[cold]
    #[inline(never)]
    fn singly(&self, indices: ops::Range<usize>) -> LaneAnswers {
        let mut answers = LaneAnswers::NOTHING;
        for (lane, index) in indices.enumerate() {
            let result = self.tracer.result(index);
            answers.hits[lane] = result.hit;
            answers.blocked |= u32::from(result.blocked) << lane;
        }
        answers
    }
}

/// State of a task that persists from packet to packet.
#[derive(Default)]
struct TaskState {
    stack: TraversalStack,
    /// History of packets in closest-hit searches.
    closest: PacketHistory,
    /// History of packets in any-hit searches.
    any: PacketHistory,
}

struct TilesTask<'a, 'o, T> {
    tiles: Tiles<'o>,
    tracer: &'a WideTracer<'a, T>,
}

impl<T: ClosestSearch> VectorWork for TilesTask<'_, '_, T> {
    type Out = HitCounts;

    #[inline(always)]
    fn run<I: Isa>(self) -> HitCounts {
        match self.tracer.tracer.query.rays {
            Rays::Camera(camera) => self.picture::<I>(camera),
            Rays::List(list) => self.list::<I>(list),
            Rays::OnDevice(_) => HitCounts::default(),
        }
    }
}

impl<T: ClosestSearch> TilesTask<'_, '_, T> {
    #[inline(always)]
    fn list<I: Isa>(mut self, list: &[Ray]) -> HitCounts {
        let (mut state, mut sum) = (TaskState::default(), HitCounts::default());
        let (tracer, lanes) = (self.tracer, I::Packet::ALL.count_ones() as usize);
        let first = self.tiles.index(0, 0);
        let list = &list[first..first + self.tiles.columns()];
        for (i, rays) in list.chunks(lanes).enumerate() {
            let (begin, active) = (i * lanes, (1 << rays.len()) - 1);
            let input = InputRays::listed(rays);
            let found = if extreme_lanes(&input, &tracer.tracer.geometry) & active != 0 {
                tracer.singly(first + begin..first + begin + rays.len())
            } else {
                I::outlined(AnswerLanes {
                    tracer,
                    rays: &input,
                    active,
                    state: &mut state,
                })
            };
            for lane in 0..rays.len() {
                self.tiles.set(begin + lane, 0, found.result(lane));
            }
            sum = sum + found.counts(active);
        }
        sum
    }

    #[inline(always)]
    fn picture<I: Isa>(mut self, camera: &Camera) -> HitCounts {
        let (mut state, mut sum) = (TaskState::default(), HitCounts::default());
        let size = [self.tiles.columns(), self.tiles.height()];
        let rows = I::Packet::ALL.count_ones() as usize / COLUMNS;
        for x in (0..size[0]).step_by(COLUMNS) {
            for y in (0..size[1]).step_by(rows) {
                let cell = Cell::new(&self.tiles, [x, y], rows);
                let found = I::outlined(AnswerLanes {
                    tracer: self.tracer,
                    rays: &cell.rays(camera),
                    active: cell.active,
                    state: &mut state,
                });
                self.write(&cell, [x, y], &found);
                sum = sum + found.counts(cell.active);
            }
        }
        sum
    }

    /// Writes the answers of the cell at `at`.
    #[inline(always)]
    fn write(&mut self, cell: &Cell, at: [usize; 2], found: &LaneAnswers) {
        for lane in SetLanes::<MOST_RAYS>(cell.active) {
            let (x, y) = (at[0] + lane % COLUMNS, at[1] + lane / COLUMNS);
            self.tiles.set(x, y, found.result(lane));
        }
    }
}

/// Traces the rays in the active lanes. Lists and pictures share this function, because it is slow to compile.
struct AnswerLanes<'a, 't, L, T> {
    tracer: &'t WideTracer<'a, T>,
    rays: &'t InputRays<L>,
    active: u32,
    state: &'t mut TaskState,
}

impl<I: Isa, T: ClosestSearch> Outlined<I> for AnswerLanes<'_, '_, I::Packet, T> {
    type Out = LaneAnswers;

    #[inline(always)]
    fn run(self) -> LaneAnswers {
        let (tracer, state) = (self.tracer, self.state);
        let QueryTracer {
            query,
            geometry,
            light,
            ..
        } = tracer.tracer;
        let batch = LaneBatch {
            rays: self.rays,
            scale: geometry.scale,
            active: self.active,
        };
        if query.kind == QueryKind::Any {
            let mut answers = LaneAnswers::NOTHING;
            answers.blocked = tracer.any::<I>(&batch, &NONE_SKIPPED, state);
            return answers;
        }
        let mut answers = tracer.closest::<I>(&batch, state);
        let (Some(light), hit) = (light, batch.active & answers.hit_lanes()) else {
            return answers;
        };
        if hit == 0 {
            return answers;
        }
        // Shadow rays are traced now, while the results of the rays are in the nearest caches.
        let corners = answers.corners::<I>(geometry, tracer.tree);
        let eyes = batch.rays.scaled_origin(batch.scale);
        let shadows = LaneBatch {
            rays: &shadow_rays(light, &corners, answers.weights::<I>(), &eyes),
            scale: Scale::ONE,
            active: hit,
        };
        let mut skipped = NONE_SKIPPED;
        for (skipped, hit) in skipped.iter_mut().zip(&answers.hits) {
            *skipped = hit.triangle;
        }
        answers.blocked = tracer.any::<I>(&shadows, &skipped, state);
        answers
    }
}

/// History of whether packets were completed or abandoned.
#[derive(Default)]
struct PacketHistory {
    /// Number of packets in a row that were abandoned.
    failed: u32,
    /// Number of batches to trace ray by ray before the next packet is tried.
    pause: u32,
}

/// The longest pause, in batches.
const PAUSE: u32 = 7;

impl PacketHistory {
    /// Creates a packet of a group's rays. Returns `None` during a pause, if the rays cannot form a packet, or if the
    /// tree uses `own_padding`, since packets pad every box as much as the root box.
    #[inline(always)]
    fn packet<I: Isa>(
        &mut self,
        group: &PreparedRays<I::Packet>,
        tree: &Bvh8,
    ) -> Option<PacketOf<I>> {
        let tries = self.pause == 0 && !tree.own_padding;
        self.pause = self.pause.saturating_sub(1);
        if tries { RayPacket::of(group) } else { None }
    }

    /// Records whether a packet was completed.
    #[inline(always)]
    fn record(&mut self, succeeded: bool) {
        self.failed = if succeeded { 0 } else { self.failed + 1 };
        self.pause = ((1 << self.failed.min(8)) - 1).min(PAUSE);
    }
}
