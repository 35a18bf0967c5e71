//! The output of traces, kept until it is too old to be asked for.

use crate::device::Gpu;
use crate::memory::{Buffer, BufferUse};
use crate::transfer::{Transfer, Window};
use backend::{FRAMES_IN_FLIGHT, Hits, Intersector, Query, QueryKind, Rays, Result, Ticket};
use geom::{Hit, Ray};
use std::collections::VecDeque;
use std::sync::Arc;

/// Traces, oldest first.
#[derive(Default)]
pub(crate) struct Traces {
    kept: VecDeque<Trace>,
    /// Recorded but not submitted yet.
    pub(crate) pending: Option<Trace>,
}

/// One trace: its output, and its rays if kernels do not make them.
pub(crate) struct Trace {
    ticket: Ticket,
    pub(crate) count: usize,
    pub(crate) kind: QueryKind,
    /// Whether there was a tree to trace. Without one every ray misses.
    pub(crate) has_tree: bool,
    /// Each is there if a query ever needed it.
    pub(crate) hits: Option<Buffer>,
    pub(crate) blocked: Option<Buffer>,
    pub(crate) rays: Option<Buffer>,
    /// Whether any of those rays is extreme.
    pub(crate) extremes: bool,
}

impl Traces {
    /// Buffers for a query, taken from the oldest trace if they fit. That one is
    /// older than the submissions that may be under way, so nothing uses it any more.
    pub(crate) fn make(
        &mut self,
        gpu: &Arc<Gpu>,
        query: &Query<'_>,
        (intersector, has_tree): (Intersector, bool),
        is_extreme: impl Fn(&Ray) -> bool,
    ) -> Result<Trace> {
        let old = match self.kept.len() > FRAMES_IN_FLIGHT {
            true => self.kept.pop_front(),
            false => None,
        };
        let (hits, blocked, rays) = old.map_or((None, None, None), |o| (o.hits, o.blocked, o.rays));
        let (count, kind) = (query.rays.count(), query.kind);
        let fit = |what, bytes: usize, needed: bool, place, spare| match needed && has_tree {
            true => Buffer::fitting(gpu, what, bytes as u64, place, spare).map(Some),
            false => Ok(spare),
        };
        let given = are_given(query);
        let mut rays = fit("rays", count * 32, given, BufferUse::Upload, rays)?;
        let mut extremes = false;
        if let Some(rays) = rays.as_mut().filter(|_| given && has_tree) {
            extremes = upload(query.rays, rays, is_extreme);
        }
        let closest = kind != QueryKind::Any;
        let any = kind != QueryKind::Closest || intersector == Intersector::Exact;
        let words = shaders::occluded_words(intersector, count as u64) as usize;
        Ok(Trace {
            ticket: Ticket(0),
            count,
            kind,
            has_tree,
            hits: fit("hits", count * 16, closest, BufferUse::Device, hits)?,
            blocked: fit("shadows", words * 4, any, BufferUse::Device, blocked)?,
            rays,
            extremes,
        })
    }

    /// The trace that is pending was submitted, if there is one.
    pub(crate) fn submitted(&mut self, ticket: Ticket) {
        let pending = self.pending.take();
        self.kept
            .extend(pending.map(|trace| Trace { ticket, ..trace }));
    }

    /// What a submission found.
    ///
    /// # Panics
    /// If it had no trace, or was too long ago.
    pub(crate) fn get(&self, ticket: Ticket) -> &Trace {
        let found = self.kept.iter().find(|t| t.ticket == ticket);
        found.expect("this submission had no trace, or was too long ago")
    }
}

/// Whether the rays go to the device one by one: no kernel seeks any hit of a camera's rays, and
/// made here they have the same bits.
pub(crate) fn are_given(query: &Query<'_>) -> bool {
    matches!(query.rays, Rays::List(_)) || query.kind == QueryKind::Any
}

/// Whether any ray is extreme.
fn upload(rays: Rays<'_>, to: &mut Buffer, is_extreme: impl Fn(&Ray) -> bool) -> bool {
    match rays {
        Rays::List(list) => write(to, list.iter().copied(), is_extreme),
        Rays::Camera(camera) => write(to, camera.rays(), is_extreme),
    }
}

fn write(
    to: &mut Buffer,
    rays: impl Iterator<Item = Ray>,
    is_extreme: impl Fn(&Ray) -> bool,
) -> bool {
    // A direction of zero marks a ray that hits nothing.
    let void = Ray {
        direction: [0.0; 3],
        ..Ray::new([0.0; 3], [0.0; 3])
    };
    let mut extremes = false;
    for (row, ray) in to.view_mut::<Ray>().iter_mut().zip(rays) {
        *row = if ray.is_valid() { ray } else { void };
        extremes |= is_extreme(row);
    }
    extremes
}

impl Trace {
    /// Copies what was found. The submission must be finished.
    pub(crate) fn fetch(
        &self,
        gpu: &Arc<Gpu>,
        (road, window): (&mut Transfer, &mut Window),
        out: &mut Hits,
    ) -> Result<()> {
        out.closest.clear();
        out.blocked.clear();
        if self.kind != QueryKind::Any {
            match self.hits.as_ref().filter(|_| self.has_tree) {
                Some(hits) => {
                    let hits = window.look::<Hit>(gpu, road, hits, self.count)?;
                    out.closest.extend_from_slice(hits);
                }
                None => out.closest.resize(self.count, Hit::MISS),
            }
        }
        if self.kind != QueryKind::Closest {
            match self.blocked.as_ref().filter(|_| self.has_tree) {
                Some(blocked) => {
                    let blocked = window.look::<u32>(gpu, road, blocked, self.count)?;
                    out.blocked.extend(blocked.iter().map(|&b| b as u8));
                }
                None => out.blocked.resize(self.count, 0),
            }
        }
        Ok(())
    }
}
