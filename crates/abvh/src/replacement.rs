//! Replaces meshes while the scene is traced.

use crate::disposal::Disposal;
use crate::loaded::ResidentScene;
use crate::state::TracerState;
use crate::{Error, Mesh, MeshId, Result, Tracer, Update};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

/// A replacement of a mesh in preparation: see [`Tracer::replace`]. Dropping it instead of [committing](Tracer::commit)
/// it cancels the replacement.
#[must_use = "nothing is replaced before it is committed"]
pub struct Replacement {
    mesh: MeshId,
    /// The new mesh. It is prepared again if another mesh was replaced in the meantime.
    with: Mesh,
    /// Number of replacements that were committed before this one was started.
    commits: u64,
    /// Shared with the tracer, and identifies it.
    disposal: Arc<Disposal>,
    is_cancelled: Arc<AtomicBool>,
    /// `None` once the thread is joined.
    preparation: Option<JoinHandle<Result<ResidentScene>>>,
}

impl Replacement {
    /// Returns the mesh that is replaced.
    #[must_use]
    pub fn mesh(&self) -> MeshId {
        self.mesh
    }

    /// Returns whether the preparation is finished. [`Tracer::commit`] then does not wait for it, unless another mesh
    /// was replaced in the meantime.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.preparation
            .as_ref()
            .is_none_or(JoinHandle::is_finished)
    }

    fn wait(mut self) -> Result<ResidentScene> {
        match self.preparation.take().map(JoinHandle::join) {
            Some(Ok(prepared)) => prepared,
            _ => Err(Error::Device("the preparation panicked".to_owned())),
        }
    }
}

impl Drop for Replacement {
    fn drop(&mut self) {
        if let Some(preparation) = self.preparation.take() {
            self.is_cancelled.store(true, Ordering::Relaxed);
            self.disposal.begin(move || drop(preparation.join()));
        }
    }
}

impl fmt::Debug for Replacement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Replacement of mesh {}", self.mesh.index())
    }
}

impl Tracer {
    /// Starts to replace a mesh. The new mesh may have other numbers of vertices and triangles, and may move in another
    /// way.
    ///
    /// The new scene is loaded and its first tree built in parallel with steps, which use the old scene until
    /// [`Tracer::commit`]. A GPU is not opened again. It holds both scenes until the commit, and until the last results
    /// of the old scene are dropped.
    ///
    /// ```
    /// # use abvh::{Device, Mesh, Query, Ray, Scene, Tracer};
    /// let (low, high) = ([[0., 0., 0.], [2., 0., 0.], [0., 2., 0.]], [[0., 0., 1.], [2., 0., 1.], [0., 2., 1.]]);
    /// let mut scene = Scene::new();
    /// let mesh = scene.add(Mesh::fixed(&low, &[[0, 1, 2]])?);
    /// let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
    /// let both = [low, high].concat();
    /// let mut replacement = Some(tracer.replace(mesh, Mesh::fixed(&both, &[[0, 1, 2], [3, 4, 5]])?)?);
    /// loop {
    ///     if let Some(ready) = replacement.take_if(|r| r.is_ready()) {
    ///         tracer.commit(ready)?;
    ///     }
    ///     let mut step = tracer.step(0.0);
    ///     let query = step.trace(&[Ray::new([0.5, 0.5, 3.0], [0.0, 0.0, -1.0])], Query::Closest)?;
    ///     let done = step.submit()?;
    ///     let hit = tracer.hits(done, query)?.closest(0).unwrap();
    ///     assert_eq!(hit.mesh, mesh);
    ///     if replacement.is_none() {
    ///         assert_eq!((hit.triangle, hit.t), (1, 2.0));
    ///         break;
    ///     }
    /// }
    /// # Ok::<_, abvh::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::ForeignMesh`]; [`Error::Unsupported`] if no thread can be started.
    pub fn replace(&self, mesh: MeshId, with: Mesh) -> Result<Replacement> {
        let mut state = self.shared_state();
        let index = mesh.within(&state.current.joined.meshes)?;
        let prepare = state.preparation(index, with.clone())?;
        let is_cancelled = Arc::<AtomicBool>::default();
        let cancelled = Arc::clone(&is_cancelled);
        let thread = thread::Builder::new().name("abvh-replace".into());
        let started = thread.spawn(move || prepare(&cancelled));
        let no_thread = |e| Error::Unsupported(format!("no thread for the replacement: {e}"));
        Ok(Replacement {
            mesh,
            with,
            commits: state.commits,
            disposal: Arc::clone(&state.disposal),
            is_cancelled,
            preparation: Some(started.map_err(no_thread)?),
        })
    }

    /// Replaces a mesh from the next step on. Waits until the replacement is [ready](Replacement::is_ready).
    ///
    /// Other meshes keep their current positions, and all meshes keep their [`MeshId`]. Results of earlier steps remain
    /// available as usual, with triangle indices of the old mesh.
    ///
    /// If another mesh was replaced since this replacement was started, the call prepares it again and waits for that.
    ///
    /// # Errors
    /// [`Error::Conflict`] if the same mesh was replaced since this replacement was started.
    /// [`Error::ForeignReplacement`]. [`Error::Misuse`] if an encoded step is not submitted or was rejected.
    /// [`Error::KeyFrame`] if a key frame cannot be read. The errors of
    /// [`TracerBuilder::build`](crate::TracerBuilder::build). After an error, the old mesh remains.
    pub fn commit(&mut self, replacement: Replacement) -> Result<()> {
        let (mesh, state) = (replacement.mesh, self.state());
        if !Arc::ptr_eq(&state.disposal, &replacement.disposal) {
            return Err(Error::ForeignReplacement(mesh));
        }
        let newest = state.replaced.get(&mesh.index());
        if newest.is_some_and(|&commit| commit > replacement.commits) {
            return Err(Error::Conflict(mesh));
        }
        let mut next = if state.commits == replacement.commits {
            replacement.wait()?
        } else {
            let prepare = state.preparation(mesh.index(), replacement.with.clone())?;
            prepare(&replacement.is_cancelled)?
        };
        next.follow(&mut state.current, mesh.index())?;
        let before = std::mem::replace(&mut state.current, next);
        state.former.push(before);
        // Drops former scenes without results.
        state.keep_from(0);
        state.commits += 1;
        state.replaced.insert(mesh.index(), state.commits);
        Ok(())
    }
}

impl TracerState {
    /// Returns a closure that loads the scene with another mesh and builds its first tree. It runs on the threads that
    /// build trees, since steps need the others.
    fn preparation(
        &mut self,
        mesh: usize,
        with: Mesh,
    ) -> Result<impl FnOnce(&AtomicBool) -> Result<ResidentScene> + Send + use<>> {
        let current = &mut self.current;
        let (tracer_builder, open) = (self.tracer_builder.clone(), current.share_device());
        let split = current.joined.splitter();
        let (newest, time) = (current.joined.newest()?, current.joined.time);
        // One query for each set of kernels that steps have used, so that `warm_up` compiles the same kernels.
        let forms = current.traced_forms.clone();
        let threads = match current.update {
            // With this policy, tracing and building do not overlap, so the builder threads may use all cores. A
            // replacement is built while steps trace, so leave cores for steps.
            Update::Refit => tracer_builder.start_builder_threads(self.kind, Update::Async)?,
            _ => current.builder_threads.clone(),
        };
        Ok(move |is_cancelled: &AtomicBool| {
            let positions = newest.to_vec();
            // Future steps reuse this memory.
            drop(newest);
            let mut meshes = split();
            let number = meshes[mesh].number;
            meshes[mesh] = Mesh { number, ..with };
            let update = tracer_builder.policy(&meshes);
            let backend = open(tracer_builder.host_threads(update)?)?;
            let (options, shared) = (tracer_builder.options(update), threads.clone());
            threads.install(move || {
                let mut loaded = ResidentScene::new(meshes, backend, options, shared)?;
                loaded.joined.copy_moved_from(&positions, mesh);
                if is_cancelled.load(Ordering::Relaxed) {
                    return Err(Error::Device("the replacement was cancelled".to_owned()));
                }
                loaded.warm_up(time, &forms)?;
                Ok(loaded)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::{Device, Mesh, Query, Ray, Scene, Tracer};

    #[test]
    fn commits_drop_scenes_without_results() {
        let mesh = || Mesh::fixed(&[[0.0; 3]; 3], &[[0, 1, 2]]).unwrap();
        let mut scene = Scene::new();
        let id = scene.add(mesh());
        let builder = Tracer::builder().device(Device::CpuRef).threads(1);
        let mut tracer = builder.build(scene).unwrap();
        let mut step = tracer.step(0.0);
        let ray = Ray::new([0.0; 3], [1.0; 3]);
        step.trace(&[ray], Query::Any).unwrap();
        step.submit().unwrap();
        for _ in 0..3 {
            let replacement = tracer.replace(id, mesh()).unwrap();
            tracer.commit(replacement).unwrap();
        }
        assert_eq!(tracer.state().former.len(), 1);
        // Replacements are loaded on the same kind of backend.
        let backend = tracer.state().current.driver.backend();
        assert_eq!(backend.device().backend, "cpu-ref");
    }
}
