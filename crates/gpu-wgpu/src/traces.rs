//! The output of traces, kept until it is too old to be asked for.

use crate::buffers::{Window, storage, write};
use crate::device::Gpu;
use backend::{FRAMES_IN_FLIGHT, Hits, Intersector, QueryKind, Result, Ticket};
use geom::{Hit, Ray};
use std::collections::VecDeque;
use wgpu::Buffer;

/// Traces, oldest first.
#[derive(Default)]
pub(crate) struct Traces {
    kept: VecDeque<Trace>,
    /// Recorded but not submitted yet.
    pub(crate) pending: Option<Trace>,
}

/// The output of one trace, and its rays if they were given.
pub(crate) struct Trace {
    ticket: Ticket,
    pub(crate) count: usize,
    kind: QueryKind,
    pub(crate) hits: Buffer,
    pub(crate) blocked: Buffer,
    pub(crate) rays: Option<Buffer>,
    /// Whether any of those rays is extreme.
    pub(crate) extremes: bool,
}

impl Traces {
    /// Buffers for so many rays, taken from the oldest trace if they fit.
    pub(crate) fn make(
        &mut self,
        gpu: &Gpu,
        count: usize,
        (kind, intersector): (QueryKind, Intersector),
        rays: Option<&[Ray]>,
        is_extreme: impl Fn(&Ray) -> bool,
    ) -> Result<Trace> {
        gpu.within("the hits", count as u64 * 16)?;
        gpu.within("the rays", rays.map_or(0, |r| r.len() as u64 * 32))?;
        let old = match self.kept.len() > FRAMES_IN_FLIGHT {
            true => self.kept.pop_front(),
            false => None,
        };
        // The queue runs in order, so what older submissions do with these buffers is done before.
        let (hits, blocked, spare) = old.map_or((None, None, None), |o| {
            (Some(o.hits), Some(o.blocked), o.rays)
        });
        let extremes = rays.is_some_and(|rays| rays.iter().any(is_extreme));
        let rays = rays.map(|rays| upload(gpu, rays, spare)).transpose()?;
        let words = shaders::occluded_words(intersector, count as u64);
        Ok(Trace {
            ticket: Ticket(0),
            count,
            kind,
            hits: fitting(gpu, "hits", count as u64 * 16, hits)?,
            blocked: fitting(gpu, "shadows", words * 4, blocked)?,
            rays,
            extremes,
        })
    }

    /// The trace that is pending was submitted, if there is one.
    pub(crate) fn submitted(&mut self, ticket: Ticket) -> bool {
        let pending = self.pending.take();
        let traced = pending.is_some();
        self.kept
            .extend(pending.map(|trace| Trace { ticket, ..trace }));
        traced
    }

    /// Bytes of device memory.
    pub(crate) fn bytes(&self) -> u64 {
        let each = |t: &Trace| {
            let rays = t.rays.as_ref().map_or(0, Buffer::size);
            t.hits.size() + t.blocked.size() + rays
        };
        self.kept.iter().chain(&self.pending).map(each).sum()
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

impl Trace {
    /// Every ray misses: an empty tree has no node to trace.
    pub(crate) fn fill_misses(&self, gpu: &Gpu) -> Result<()> {
        write(gpu, &self.hits, 0, &vec![Hit::MISS; self.count])?;
        write(gpu, &self.blocked, 0, &vec![0_u32; self.count])
    }

    pub(crate) fn fetch(&self, gpu: &Gpu, window: &mut Window, out: &mut Hits) -> Result<()> {
        out.closest.clear();
        out.blocked.clear();
        if self.kind != QueryKind::Any {
            out.closest = window.read(gpu, &self.hits, self.count)?;
        }
        if self.kind != QueryKind::Closest {
            let blocked: Vec<u32> = window.read(gpu, &self.blocked, self.count)?;
            out.blocked.extend(blocked.iter().map(|&b| b as u8));
        }
        Ok(())
    }
}

fn fitting(gpu: &Gpu, what: &str, bytes: u64, spare: Option<Buffer>) -> Result<Buffer> {
    match spare.filter(|b| b.size() >= bytes) {
        Some(buffer) => Ok(buffer),
        None => storage(gpu, what, bytes),
    }
}

fn upload(gpu: &Gpu, rays: &[Ray], spare: Option<Buffer>) -> Result<Buffer> {
    let buffer = fitting(gpu, "rays", size_of_val(rays) as u64, spare)?;
    // A direction of zero marks a ray that hits nothing.
    let void = Ray {
        direction: [0.0; 3],
        ..Ray::new([0.0; 3], [0.0; 3])
    };
    let valid = |r: &Ray| if r.is_valid() { *r } else { void };
    let rows: Vec<Ray> = rays.iter().map(valid).collect();
    write(gpu, &buffer, 0, &rows)?;
    Ok(buffer)
}
