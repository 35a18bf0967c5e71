//! Steps: the positions of meshes at one time, and the queries traced there.

use crate::loaded::Batch;
use crate::motion::{Motion, moved};
use crate::tracer::State;
use crate::vertices::set;
use crate::{Error, Matrix, MeshId, Point, Result};
use backend::{QueryKind, Rays};
use geom::{Camera, copy_in_parallel};
use std::sync::Arc;

/// Kind of result for each ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is any hit. This is faster, and sufficient for shadows and line of sight.
    Any,
}

impl Query {
    /// Returns the size in bytes of a result in device memory.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) fn answer_bytes(self) -> usize {
        match self {
            Self::Closest => size_of::<geom::Hit>(),
            Self::Any => size_of::<u32>(),
        }
    }

    fn kind(self) -> QueryKind {
        match self {
            Self::Closest => QueryKind::Closest,
            Self::Any => QueryKind::Any,
        }
    }
}

/// Source of a streamed mesh's vertices.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// Host memory, which is read before the call returns.
    Host(&'a [Point]),
    /// A buffer on the program's wgpu device ([`crate::own_device`]), with three consecutive floats per vertex.
    ///
    /// It needs the usage `COPY_SRC`, and is read faster if it also has the usage `STORAGE`. It is read in queue order
    /// when the step's first query is traced. The buffer must belong to the same wgpu instance, since wgpu confuses
    /// buffers of different instances. To build a tree for the predicted positions, the library reads back the vertices
    /// of two steps.
    #[cfg(feature = "wgpu")]
    Wgpu(wgpu::BufferSlice<'a>),
    /// A buffer that is shared with another API of the GPU ([`crate::external_memory`]), with three consecutive floats
    /// per vertex.
    ///
    /// It is read when the next query is traced, or before the signal of [`Step::synchronize`]. To build a tree for the
    /// predicted positions, the library reads back the vertices of two steps.
    #[cfg(feature = "vulkan")]
    External {
        /// A buffer of the same tracer.
        buffer: &'a crate::external_memory::ExternalBuffer,
        /// Offset of the first vertex in bytes, a multiple of 4.
        offset: u64,
    },
}

/// Identifies a submitted step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct StepId(pub(crate) u64);

/// Identifies a query of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueryId {
    pub(crate) step: StepId,
    pub(crate) query: u32,
}

/// A step in preparation: moves meshes and traces queries.
///
/// Meshes that the step does not move keep their positions. A step that is dropped instead of [submitted](Step::submit)
/// has moved its meshes, but its queries have no results, and it does not count as a step.
#[derive(Debug)]
pub struct Step<'t> {
    pub(crate) tracer: &'t mut State,
    pub(crate) id: StepId,
    /// Time in key frames.
    pub(crate) time: f64,
    /// Number of queries so far.
    pub(crate) queries: u32,
    /// Queries that are traced together when the step ends.
    pub(crate) deferred: Vec<(QueryId, Deferred, Query)>,
    pub(crate) is_submitted: bool,
}

impl Drop for Step<'_> {
    fn drop(&mut self) {
        if !self.is_submitted {
            self.tracer.current.drop_step(self.id);
        }
    }
}

/// Rays that are read when the step ends.
#[derive(Debug)]
pub(crate) enum Deferred {
    Camera(Camera),
    #[cfg(feature = "wgpu")]
    Nothing,
    #[cfg(feature = "wgpu")]
    Wgpu(gpu_wgpu::LentRays<wgpu::Buffer>, usize),
}

impl Deferred {
    pub(crate) fn query(&self, query: Query) -> backend::Query<'_> {
        let rays = match self {
            Self::Camera(camera) => Rays::Camera(camera),
            #[cfg(feature = "wgpu")]
            Self::Nothing => Rays::List(&[]),
            #[cfg(feature = "wgpu")]
            &Self::Wgpu(_, count) => Rays::OnDevice(count),
        };
        let kind = query.kind();
        backend::Query { rays, kind }
    }
}

impl Step<'_> {
    /// Sets all vertices of a streamed mesh.
    ///
    /// # Errors
    /// [`Error::Count`]. [`Error::Misuse`] if a buffer cannot be read. The errors of [`Step::vertices_mut`].
    pub fn vertices(&mut self, mesh: MeshId, source: Source<'_>) -> Result<()> {
        let index = self.may_stream(mesh)?;
        let current = &mut self.tracer.current;
        match source {
            Source::Host(vertices) => {
                let expected = current.joined.range_of(index).len();
                check(mesh, "vertices", expected, vertices.len())?;
                copy_in_parallel(current.joined.vertices_of(index), vertices);
                Ok(())
            }
            #[cfg(feature = "wgpu")]
            Source::Wgpu(from) => current.bring_points((mesh, index), from),
            #[cfg(feature = "vulkan")]
            Source::External { buffer, offset } => current.bring_external(index, (buffer, offset)),
        }
    }

    /// Returns the memory of a streamed mesh's vertices. The caller must write all vertices. If the device can read
    /// this memory, nothing is copied. It initially holds vertices of an earlier step.
    ///
    /// # Errors
    /// [`Error::ForeignMesh`]. [`Error::Motion`] for meshes that are not streamed. [`Error::TooLate`] after a query.
    pub fn vertices_mut(&mut self, mesh: MeshId) -> Result<&mut [Point]> {
        let index = self.may_stream(mesh)?;
        Ok(self.tracer.current.joined.vertices_of(index))
    }

    fn may_stream(&self, mesh: MeshId) -> Result<usize> {
        let index = self.may_move(mesh)?;
        let motion = &*self.tracer.current.joined.meshes[index].motion;
        let what = "vertices";
        let is_streamed = matches!(motion, Motion::Streamed(_));
        (is_streamed.then_some(index)).ok_or(Error::Motion { mesh, what })
    }

    /// Sets one matrix for each part of a rigid mesh. Matrices after the last part that has a vertex are ignored, such
    /// as those of a robot's last links without geometry.
    ///
    /// # Errors
    /// [`Error::Count`] for too few matrices. [`Error::ForeignMesh`]. [`Error::Motion`] for meshes that are not rigid.
    /// [`Error::TooLate`] after a query.
    pub fn poses(&mut self, mesh: MeshId, matrices: &[Matrix]) -> Result<()> {
        let index = self.may_move(mesh)?;
        let joined = &mut self.tracer.current.joined;
        let motion = Arc::clone(&joined.meshes[index].motion);
        let Motion::Rigid {
            rest,
            part_of_vertex,
            parts,
        } = &*motion
        else {
            let what = "matrices";
            return Err(Error::Motion { mesh, what });
        };
        if matrices.len() < *parts {
            check(mesh, "matrices", *parts, matrices.len())?;
        }
        let matrix = |v: usize| &matrices[part_of_vertex[v] as usize];
        set(joined.vertices_of(index), |v| moved(matrix(v), rest[v]));
        Ok(())
    }

    fn may_move(&self, mesh: MeshId) -> Result<usize> {
        let index = mesh.within(&self.tracer.current.joined.meshes)?;
        match self.queries {
            0 => Ok(index),
            _ => Err(Error::TooLate),
        }
    }

    /// Traces a list of rays, or the rays of a camera: one through the middle of each pixel, row by row from the top.
    ///
    /// A list is read before the call returns. A ray misses if its direction is zero, a number is not finite, or its
    /// interval is empty. Cameras are traced when the step is submitted, in one submission if the device can. Many
    /// small cameras then take little longer than one large camera.
    ///
    /// # Errors
    /// [`Error::KeyFrame`] if a key frame cannot be read. [`Error::Unsupported`] for more rays than the device can
    /// trace. [`Error::Device`].
    pub fn trace<'r>(&mut self, rays: impl Into<Rays<'r>>, query: Query) -> Result<QueryId> {
        let rays = rays.into();
        if let Rays::Camera(camera) = rays {
            return Ok(self.defer(Deferred::Camera(*camera), query));
        }
        let id = self.next_id();
        let kind = query.kind();
        let query = backend::Query { rays, kind };
        let batch = Batch {
            ids: &[id],
            queries: &[query],
        };
        let begun = self.tracer.begin(self.time, batch);
        self.keep_if(id, begun)
    }

    /// Removes the newest query if it failed. If it was the first, meshes can be moved again.
    pub(crate) fn keep_if(&mut self, id: QueryId, begun: Result<()>) -> Result<QueryId> {
        if begun.is_err() {
            self.queries -= 1;
            (self.tracer.current.results).retain(|answer| answer.query != id);
        }
        begun.map(|()| id)
    }

    pub(crate) fn defer(&mut self, rays: Deferred, query: Query) -> QueryId {
        let id = self.next_id();
        self.deferred.push((id, rays, query));
        id
    }

    pub(crate) fn next_id(&mut self) -> QueryId {
        self.queries += 1;
        QueryId {
            step: self.id,
            query: self.queries - 1,
        }
    }

    /// Ends the step. Its queries run while the next step is prepared. [`Tracer::hits`](crate::Tracer::hits) waits for
    /// them.
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
        let deferred = self.deferred.iter();
        let queries = deferred.map(|(id, rays, query)| (*id, rays.query(*query)));
        let (ids, queries): (Vec<_>, Vec<_>) = queries.unzip();
        #[cfg(feature = "wgpu")]
        self.tracer.current.lend_rays(&self.deferred);
        if queries.is_empty() {
            Ok(())
        } else {
            let batch = Batch {
                ids: &ids,
                queries: &queries,
            };
            self.tracer.begin(self.time, batch)
        }
    }
}

/// Returns an error unless rays and results are in separate buffers.
#[cfg(any(feature = "vulkan", feature = "wgpu"))]
pub(crate) fn apart(are_apart: bool) -> Result<()> {
    let why = || Error::Misuse("answers would be written over rays".into());
    are_apart.then_some(()).ok_or_else(why)
}

pub(crate) fn check(mesh: MeshId, what: &'static str, expected: usize, found: usize) -> Result<()> {
    if expected == found {
        Ok(())
    } else {
        Err(Error::Count {
            mesh,
            what,
            expected,
            found,
        })
    }
}
