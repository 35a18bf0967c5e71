//! Steps: the positions of meshes at one time, and the queries traced there.

use crate::motion::{MeshMotion, transform};
use crate::query::{DeferredQuery, DeferredRays, QueryId, StepId};
use crate::state::TracerState;
use crate::{Error, Matrix, MeshId, Point, Query, Result};
use backend::Rays;
use geom::{copy_in_parallel, set_each};
use std::sync::Arc;

/// Source of a streamed mesh's vertices.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// Host memory, which is read before the call returns.
    Host(&'a [Point]),
    /// A buffer on the program's wgpu device ([`crate::own_device`]), with three consecutive floats per vertex.
    ///
    /// It needs the usage `COPY_SRC`, and is read faster if it also has the usage `STORAGE`. It is read in queue order
    /// when the step's first query is traced. The buffer must belong to the same wgpu instance: see
    /// [`OwnDevice`](crate::own_device::OwnDevice). To build a tree for the predicted positions, the library reads back
    /// the vertices of two steps.
    #[cfg(feature = "wgpu")]
    Wgpu(wgpu::BufferSlice<'a>),
    /// A buffer that is shared with another API of the GPU ([`crate::external_memory`]), with three consecutive floats
    /// per vertex.
    ///
    /// It is read when the next query is traced. In a step without queries, it is read before the signal of
    /// [`Step::synchronize`]. To build a tree for the predicted positions, the library reads back the vertices of two
    /// steps.
    #[cfg(feature = "vulkan")]
    External {
        /// A buffer of the same tracer.
        buffer: &'a crate::external_memory::ExternalBuffer,
        /// Offset of the first vertex in bytes, a multiple of 4.
        offset: u64,
    },
}

/// A step in preparation: moves meshes and traces queries.
///
/// Meshes that the step does not move keep their positions. A step that is dropped instead of [submitted](Step::submit)
/// has moved its meshes, but its queries have no results, and it does not count as a step.
#[derive(Debug)]
pub struct Step<'t> {
    pub(crate) tracer: &'t mut TracerState,
    pub(crate) id: StepId,
    /// Time in key frames.
    pub(crate) time: f64,
    /// Number of queries so far.
    pub(crate) queries: u32,
    /// Queries that are traced together when the step ends.
    pub(crate) deferred: Vec<DeferredQuery>,
    pub(crate) is_submitted: bool,
}

impl Drop for Step<'_> {
    fn drop(&mut self) {
        if !self.is_submitted {
            self.tracer.current.drop_step(self.id);
        }
    }
}

impl Step<'_> {
    /// Sets all vertices of a streamed mesh.
    ///
    /// # Errors
    /// [`Error::Count`]. [`Error::Misuse`] if a buffer cannot be read. [`Error::Unsupported`] for `Source::Wgpu` on a
    /// device that is not wgpu's, and for `Source::External` on a device that is not Vulkan's. The errors of
    /// [`Step::vertices_mut`].
    pub fn vertices(&mut self, mesh: MeshId, source: Source<'_>) -> Result<()> {
        let index = self.streamed_index(mesh)?;
        let current = &mut self.tracer.current;
        match source {
            Source::Host(vertices) => {
                let expected = current.joined.range_of(index).len();
                Error::check_count(mesh, "vertices", expected, vertices.len())?;
                copy_in_parallel(current.joined.vertices_of(index), vertices);
                Ok(())
            }
            #[cfg(feature = "wgpu")]
            Source::Wgpu(from) => current.set_wgpu_vertices(mesh, from),
            #[cfg(feature = "vulkan")]
            Source::External { buffer, offset } => {
                current.set_external_vertices(index, buffer, offset)
            }
        }
    }

    /// Returns the memory of a streamed mesh's vertices. The caller must write all vertices. If the device can read
    /// this memory, nothing is copied. It initially holds vertices of an earlier step.
    ///
    /// # Errors
    /// [`Error::ForeignMesh`]. [`Error::Motion`] for meshes that are not streamed. [`Error::TooLate`] after a query.
    pub fn vertices_mut(&mut self, mesh: MeshId) -> Result<&mut [Point]> {
        let index = self.streamed_index(mesh)?;
        Ok(self.tracer.current.joined.vertices_of(index))
    }

    fn streamed_index(&self, mesh: MeshId) -> Result<usize> {
        let index = self.movable_index(mesh)?;
        let motion = &*self.tracer.current.joined.meshes[index].motion;
        let what = "vertices";
        let is_streamed = matches!(motion, MeshMotion::Streamed(_));
        (is_streamed.then_some(index)).ok_or(Error::Motion { mesh, what })
    }

    /// Sets one matrix for each part of a rigid mesh. Matrices after the last part that has a vertex are ignored, such
    /// as those of a robot's last links without geometry.
    ///
    /// # Errors
    /// [`Error::Count`] for too few matrices. [`Error::ForeignMesh`]. [`Error::Motion`] for meshes that are not rigid.
    /// [`Error::TooLate`] after a query.
    pub fn poses(&mut self, mesh: MeshId, matrices: &[Matrix]) -> Result<()> {
        let index = self.movable_index(mesh)?;
        let joined = &mut self.tracer.current.joined;
        let motion = Arc::clone(&joined.meshes[index].motion);
        let MeshMotion::Rigid {
            rest,
            part_of_vertex,
            parts,
        } = &*motion
        else {
            let what = "matrices";
            return Err(Error::Motion { mesh, what });
        };
        if matrices.len() < *parts {
            Error::check_count(mesh, "matrices", *parts, matrices.len())?;
        }
        let matrix = |v: usize| &matrices[part_of_vertex[v] as usize];
        set_each(joined.vertices_of(index), |v| transform(matrix(v), rest[v]));
        Ok(())
    }

    fn movable_index(&self, mesh: MeshId) -> Result<usize> {
        let index = mesh.within(&self.tracer.current.joined.meshes)?;
        match self.queries {
            0 => Ok(index),
            _ => Err(Error::TooLate),
        }
    }

    /// Traces a list of rays, or the rays of a camera: one through the middle of each pixel, row by row from the top.
    ///
    /// A list is read before the call returns. A ray misses if its direction is zero, its origin or direction is not
    /// finite, or its interval is empty. Cameras are traced when the step is submitted, in one submission if the device
    /// can. Many small cameras then take little longer than one large camera.
    ///
    /// # Errors
    /// [`Error::KeyFrame`] if a key frame cannot be read. [`Error::Unsupported`] for more rays than the device can
    /// trace. [`Error::Misuse`] if an earlier step was encoded and its commands are not submitted or were rejected.
    /// [`Error::VerticesLost`]. [`Error::OutOfMemory`]. [`Error::DeviceLost`]. [`Error::Device`].
    pub fn trace<'r>(&mut self, rays: impl Into<Rays<'r>>, query: Query) -> Result<QueryId> {
        let rays = rays.into();
        if let Rays::Camera(camera) = rays {
            return Ok(self.defer(DeferredRays::Camera(*camera), query));
        }
        let id = self.next_id();
        let current = &mut self.tracer.current;
        let submitted = current.submit_and_record_results(self.time, &[id], &[query.of(rays)]);
        self.remove_query_if_failed(id, submitted)
    }

    /// Returns `id` if the newest query was submitted. Otherwise removes the query. If it was the step's first, meshes
    /// can be moved again.
    pub(crate) fn remove_query_if_failed(
        &mut self,
        id: QueryId,
        submitted: Result<()>,
    ) -> Result<QueryId> {
        if submitted.is_err() {
            self.queries -= 1;
            (self.tracer.current.results).retain(|result| result.query != id);
        }
        submitted.map(|()| id)
    }

    pub(crate) fn defer(&mut self, rays: DeferredRays, kind: Query) -> QueryId {
        let id = self.next_id();
        self.deferred.push(DeferredQuery { id, rays, kind });
        id
    }

    pub(crate) fn next_id(&mut self) -> QueryId {
        self.queries += 1;
        QueryId {
            step: self.id,
            query: self.queries - 1,
        }
    }

    /// Ends the step. On a GPU, its queries run while the next step is prepared.
    /// [`Tracer::hits`](crate::Tracer::hits) waits for them.
    ///
    /// # Errors
    /// As for [`Step::trace`].
    pub fn submit(mut self) -> Result<StepId> {
        self.begin_deferred()?;
        #[cfg(feature = "vulkan")]
        self.tracer.current.signal()?;
        Ok(self.end())
    }

    /// Ends the step. Drops the results of all steps except this one and the step submitted before it.
    pub(crate) fn end(mut self) -> StepId {
        self.is_submitted = true;
        self.tracer.submitted(self.id);
        self.id
    }

    pub(crate) fn begin_deferred(&mut self) -> Result<()> {
        let current = &mut self.tracer.current;
        #[cfg(feature = "wgpu")]
        current.lend_rays(&self.deferred);
        if self.deferred.is_empty() {
            return Ok(());
        }
        let ids: Vec<_> = self.deferred.iter().map(|query| query.id).collect();
        let queries: Vec<_> = self.deferred.iter().map(DeferredQuery::query).collect();
        let submitted = current.submit_and_record_results(self.time, &ids, &queries);
        #[cfg(feature = "wgpu")]
        if submitted.is_err() {
            current.drop_rays();
        }
        submitted
    }
}

/// Limits a time so that differences of times do not overflow. The limits are far beyond all key frames.
pub(crate) fn clamp_time(time: f64) -> f64 {
    let time = time.clamp(-1e100, 1e100);
    if time.is_nan() { 0.0 } else { time }
}
