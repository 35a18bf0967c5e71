//! Output buffers of traces.

use crate::{BufferTable, GpuDevice, LentRays, check_limit};
use backend::{BackendError, Hits, Intersector, Query, QueryKind, Rays, Result};
use bytemuck::Pod;
use geom::{Hit, Ray, convert_in_parallel, copy_in_parallel, set_each};
use shaders::{BufferName, work};

/// Buffers of one trace: its output, and its rays if kernels do not generate them.
pub struct TraceBuffers<D: GpuDevice> {
    /// Number of rays.
    pub count: usize,
    /// Result that is computed for each ray.
    pub kind: QueryKind,
    /// Whether pixels were shaded.
    shaded: bool,
    /// Buffers of this trace, and buffers of earlier traces, which it may reuse.
    buffers: BufferTable<D>,
    /// Buffers lent by the calling program, which replace the trace's own.
    lent: Option<LentRays<D::Buffer>>,
    /// Whether kernels write to the trace's own buffer, from which the results are copied to the lent buffer.
    pub(crate) copies_results: bool,
}

impl<D: GpuDevice> TraceBuffers<D> {
    /// Creates the buffers of the next query of a submission. Reuses those buffers of the `old` trace that are large
    /// enough.
    pub fn new(
        gpu: &mut D,
        query: &Query<'_>,
        intersector: Intersector,
        old: Option<Self>,
    ) -> Result<Self> {
        let mut buffers = match old {
            Some(old) => old.buffers,
            None => BufferTable::new(gpu, [])?,
        };
        let (count, kind) = (query.rays.count(), query.kind);
        check_limit(
            || "rays of a query".to_owned(),
            count as u64,
            u32::MAX.into(),
        )?;
        let lent = lent_rays(gpu, query)?;
        let lends_results = lent.as_ref().is_some_and(|lent| lent.results.is_some());
        let bytes = |each: usize| (count * each) as u64;
        if lent.is_none() && reads_ray_buffer(query) {
            let rays = buffers.fit(gpu, BufferName::Rays, bytes(size_of::<Ray>()))?;
            write_rays(gpu, query.rays, rays)?;
        }
        if kind != QueryKind::Any && !lends_results {
            buffers.fit(gpu, BufferName::Hits, bytes(size_of::<Hit>()))?;
        }
        // `exact` also stores undecided rays in the buffer `Occluded`. A lent buffer has no space for them.
        let is_exact = intersector == Intersector::Exact;
        let copies_results = lends_results && is_exact && kind == QueryKind::Any;
        let occluded = match kind {
            QueryKind::Any => !lends_results || copies_results,
            QueryKind::Closest => is_exact,
            QueryKind::ClosestAndShadow { .. } => true,
        };
        if occluded {
            let words = shaders::occluded_words(intersector, count as u64);
            buffers.fit(gpu, BufferName::Occluded, words * 4)?;
        }
        Ok(Self {
            count,
            kind,
            shaded: false,
            buffers,
            lent,
            copies_results,
        })
    }

    /// Returns the bytes of device memory.
    pub(crate) fn held(&self) -> u64 {
        self.buffers.held()
    }

    /// Returns the buffer that kernels of this trace bind by this name: the trace's own, or the lent one that replaces
    /// it.
    pub fn get(&self, name: BufferName) -> Option<&D::Buffer> {
        let results = match self.kind {
            QueryKind::Any => BufferName::Occluded,
            QueryKind::Closest | QueryKind::ClosestAndShadow { .. } => BufferName::Hits,
        };
        let copies = self.copies_results;
        let name = match name {
            // `extreme_rays` binds either kind of results as `Answers`.
            BufferName::Answers => results,
            // `copy_points` copies the results. It reads `CopySource` and writes `KeyFrame`.
            BufferName::CopySource if copies => results,
            name => name,
        };
        let target = if copies {
            BufferName::KeyFrame
        } else {
            results
        };
        let lent = self.lent.as_ref().and_then(|lent| match name {
            BufferName::Rays => Some(&lent.rays),
            name if name == target => lent.results.as_ref(),
            _ => None,
        });
        lent.or_else(|| self.buffers.get(name))
    }

    /// Returns the buffer of the closest hits, or `None` for an any-hit query.
    pub(crate) fn closest_hits(&self) -> Option<&D::Buffer> {
        let has_closest = self.kind != QueryKind::Any;
        self.get(BufferName::Hits).filter(|_| has_closest)
    }

    /// Allocates one pixel per ray, before the shading is recorded.
    pub(crate) fn make_pixels(&mut self, gpu: &D) -> Result<()> {
        let bytes = 4 * self.count as u64;
        self.buffers.fit(gpu, BufferName::Pixels, bytes)?;
        self.shaded = true;
        Ok(())
    }

    /// Copies the pixels. Returns whether there are any. The submission must have finished.
    pub(crate) fn fetch_pixels(&self, gpu: &mut D, out: &mut Vec<u8>) -> Result<bool> {
        let Some(pixels) = self.get(BufferName::Pixels).filter(|_| self.shaded) else {
            return Ok(false);
        };
        out.resize(4 * self.count, 0);
        gpu.read(pixels, 4 * self.count, |before, bytes: &[u8]| {
            let to = &mut out[before..][..bytes.len()];
            copy_in_parallel(to, bytes);
        })?;
        Ok(true)
    }

    /// Copies the hits from the device into `hits`. The submission must have finished.
    pub(crate) fn read_hits(&self, gpu: &mut D, hits: &mut Hits) -> Result<()> {
        let Hits { closest, blocked } = hits;
        let wants = |is_wanted: bool| if is_wanted { self.count } else { 0 };
        closest.resize(wants(self.kind != QueryKind::Any), Hit::MISS);
        blocked.resize(wants(self.kind != QueryKind::Closest), 0);
        self.read_each(gpu, BufferName::Hits, closest, |hit: Hit| hit)?;
        self.read_each(gpu, BufferName::Occluded, blocked, |word: u32| word as u8)
    }

    /// Copies one element per ray, unless `to` is empty. Uses several threads, because a single thread would take as
    /// long as the trace itself.
    fn read_each<T: Pod + Sync, U: Copy + Send>(
        &self,
        gpu: &mut D,
        name: BufferName,
        to: &mut [U],
        of: impl Fn(T) -> U + Sync,
    ) -> Result<()> {
        if to.is_empty() {
            return Ok(());
        }
        let found = self.get(name).expect("a trace has buffers for its hits");
        gpu.read(found, to.len(), |before, part: &[T]| {
            convert_in_parallel(&mut to[before..][..part.len()], part, &of);
        })
    }
}

/// Removes and returns the buffers that the program lent for this query. Returns `None` if its rays are not
/// [`Rays::OnDevice`].
///
/// # Errors
/// [`BackendError::Unsupported`] if no buffers were lent, or a lent buffer is too small.
fn lent_rays<D: GpuDevice>(gpu: &mut D, query: &Query<'_>) -> Result<Option<LentRays<D::Buffer>>> {
    if !matches!(query.rays, Rays::OnDevice(_)) {
        return Ok(None);
    }
    let result_bytes = match query.kind {
        QueryKind::Any => size_of::<u32>(),
        _ => size_of::<Hit>(),
    };
    let count = query.rays.count();
    let fits = |buffer: &D::Buffer, each: usize| D::size(buffer).bytes >= (count * each) as u64;
    // If an earlier query failed, its buffers may still be there.
    let lent = gpu.lent().rays.pop_front();
    let lent = lent.filter(|lent| {
        let results = lent.results.as_ref();
        fits(&lent.rays, size_of::<Ray>()) && results.is_none_or(|r| fits(r, result_bytes))
    });
    let refused = || BackendError::no_rays_on_device(gpu.info().device.backend);
    lent.ok_or_else(refused).map(Some)
}

/// Returns whether kernels read the rays of a query from a buffer. They generate camera rays, except for any-hit
/// queries: there the host writes the rays, with the same bits.
pub fn reads_ray_buffer(query: &Query<'_>) -> bool {
    !matches!(query.rays, Rays::Camera(_)) || query.kind == QueryKind::Any
}

/// Returns where kernels find the rays of a query.
pub(crate) fn ray_source<'a>(query: &Query<'a>) -> work::RaySource<'a> {
    match query.rays {
        Rays::Camera(camera) if !reads_ray_buffer(query) => work::RaySource::Camera(camera),
        rays => work::RaySource::Buffer(rays.count() as u32),
    }
}

/// Writes the rays of a query to a buffer, unless they are on the device already. Kernels detect invalid and extreme
/// rays.
fn write_rays<D: GpuDevice>(gpu: &mut D, rays: Rays<'_>, to: &mut D::Buffer) -> Result<()> {
    match rays {
        Rays::List(list) => gpu.write(to, list),
        Rays::Camera(camera) => {
            let mut list = vec![Ray::VOID; camera.pixels()];
            set_each(&mut list, |i| {
                camera.ray(i as u32 % camera.width, i as u32 / camera.width)
            });
            gpu.write(to, &list)
        }
        Rays::OnDevice(_) => Ok(()),
    }
}
