//! One moment of a scene: where meshes are, and what is asked of it.

use crate::motion::{Motion, moved};
use crate::tracer::State;
use crate::vertices::{copy, set};
use crate::{Error, Matrix, MeshId, Point, Result};
use backend::{QueryKind, Rays};
use geom::Camera;
use std::sync::Arc;

/// What to look for along each ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is any hit: cheaper, and enough for shadows and line of sight.
    Any,
}

impl Query {
    /// Bytes of an answer in a device's memory.
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

/// Where a streamed mesh's vertices come from.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Source<'a> {
    /// Memory of the host, read before the call returns.
    Host(&'a [Point]),
    /// A buffer on a wgpu device of the program's own ([`crate::own_device`]): three floats a vertex, one after another. It
    /// needs the usage `COPY_SRC`, and is read in the order of the queue when the step's first query is traced: in less time
    /// where it has the usage `STORAGE`, too. No host sees these vertices, so those of two steps are read back for each tree,
    /// which is built for where they are going. wgpu mistakes a buffer of another instance's for one of this.
    #[cfg(feature = "wgpu")]
    Wgpu(wgpu::BufferSlice<'a>),
    /// A buffer that is shared with another interface to the GPU ([`crate::external_memory`]): three floats a vertex, one after
    /// another. It is read when the next query is traced, or before [`Step::synchronize`] has anything signalled. No host sees
    /// these vertices, so those of two steps are read back for each tree, which is built for where they are going.
    #[cfg(feature = "vulkan")]
    External {
        /// Made by the same tracer.
        buffer: &'a crate::external_memory::ExternalBuffer,
        /// Where the first vertex lies, in bytes: a multiple of 4.
        offset: u64,
    },
}

/// A step that was submitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct StepId(pub(crate) u64);

/// A query of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueryId {
    pub(crate) step: StepId,
    pub(crate) query: u32,
}

/// A moment in the making. What is not said of a mesh stays as it was in the step before. One that is dropped instead of
/// [submitted](Step::submit) has moved meshes all the same, but its queries have no results, and it does not count as a step.
#[derive(Debug)]
pub struct Step<'t> {
    pub(crate) tracer: &'t mut State,
    pub(crate) id: StepId,
    /// Of key frames.
    pub(crate) time: f64,
    /// Queries so far.
    pub(crate) queries: u32,
    /// Those of them that are traced when the step ends, all together.
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

/// Rays that need not be read at once.
#[derive(Debug)]
pub(crate) enum Deferred {
    Camera(Camera),
    #[cfg(feature = "wgpu")]
    Nothing,
    #[cfg(feature = "wgpu")]
    Wgpu(gpu_wgpu::LentRays<wgpu::Buffer>, usize),
}

impl Deferred {
    pub(crate) fn asked(&self, query: Query) -> backend::Query<'_> {
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
    /// Moves a streamed mesh's vertices, all of them.
    ///
    /// # Errors
    /// [`Error::Count`], and those of [`Step::vertices_mut`]; [`Error::Misuse`] where such a buffer cannot be read.
    pub fn vertices(&mut self, mesh: MeshId, source: Source<'_>) -> Result<()> {
        let index = self.may_stream(mesh)?;
        let current = &mut self.tracer.current;
        match source {
            Source::Host(vertices) => {
                let expected = current.joined.range_of(index).len();
                check(mesh, "vertices", expected, vertices.len())?;
                copy(current.joined.vertices_of(index), vertices);
                Ok(())
            }
            #[cfg(feature = "wgpu")]
            Source::Wgpu(from) => current.bring_points((mesh, index), from),
            #[cfg(feature = "vulkan")]
            Source::External { buffer, offset } => current.bring_external(index, (buffer, offset)),
        }
    }

    /// The place of a streamed mesh's vertices, to be written all: where the device can, it reads them there, so nothing
    /// is copied. What it holds is of some earlier step.
    ///
    /// # Errors
    /// [`Error::ForeignMesh`], [`Error::Motion`] for other meshes, [`Error::TooLate`] after a query.
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

    /// Moves a rigid mesh's parts: one matrix each. Matrices beyond the last part that has a vertex move nothing, such as those
    /// of a robot's last links without geometry.
    ///
    /// # Errors
    /// [`Error::Count`] for too few, [`Error::ForeignMesh`], [`Error::Motion`] for other meshes, [`Error::TooLate`] after a
    /// query.
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

    /// Traces rays, or those of a camera: one through the middle of each pixel, row by row from the top. Rays are read
    /// before the call returns; those with a direction of zero, a number that is not finite or an empty interval miss.
    /// Cameras are traced when the step is submitted, together where the device can: many small ones then take little longer
    /// than a large one.
    ///
    /// # Errors
    /// [`Error::KeyFrame`] where one is read; [`Error::Unsupported`] if there are more rays than the device takes;
    /// [`Error::Device`].
    pub fn trace<'r>(&mut self, rays: impl Into<Rays<'r>>, query: Query) -> Result<QueryId> {
        let rays = rays.into();
        if let Rays::Camera(camera) = rays {
            return Ok(self.defer(Deferred::Camera(*camera), query));
        }
        let id = self.next_id();
        let kind = query.kind();
        let asked = backend::Query { rays, kind };
        let begun = self.tracer.begin(self.time, (&[id], &[asked]));
        self.keep_if(id, begun)
    }

    /// Forgets the newest query if it failed: meshes may move then as before it.
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

    /// Ends the step. Its queries run while the next step is prepared; [`Tracer::hits`](crate::Tracer::hits) waits for them.
    ///
    /// # Errors
    /// As for [`Step::trace`].
    pub fn submit(mut self) -> Result<StepId> {
        self.begin_deferred()?;
        #[cfg(feature = "vulkan")]
        self.tracer.current.signal()?;
        Ok(self.end())
    }

    /// Drops results of all steps but this one and the one submitted before.
    pub(crate) fn end(mut self) -> StepId {
        self.is_submitted = true;
        self.tracer.submitted(self.id);
        self.id
    }

    pub(crate) fn begin_deferred(&mut self) -> Result<()> {
        let deferred = self.deferred.iter();
        let queries = deferred.map(|(id, rays, query)| (*id, rays.asked(*query)));
        let (ids, queries): (Vec<_>, Vec<_>) = queries.unzip();
        #[cfg(feature = "wgpu")]
        self.tracer.current.lend_rays(&self.deferred);
        match queries.is_empty() {
            true => Ok(()),
            false => self.tracer.begin(self.time, (&ids, &queries)),
        }
    }
}

/// Refuses rays and answers that are not apart in a device's memory.
#[cfg(any(feature = "vulkan", feature = "wgpu"))]
pub(crate) fn apart(are_apart: bool) -> Result<()> {
    let why = || Error::Misuse("answers would be written over rays".into());
    are_apart.then_some(()).ok_or_else(why)
}

pub(crate) fn check(mesh: MeshId, what: &'static str, expected: usize, found: usize) -> Result<()> {
    match expected == found {
        true => Ok(()),
        false => Err(Error::Count {
            mesh,
            what,
            expected,
            found,
        }),
    }
}
