//! The meshes of a scene, joined to one list of vertices and one of triangles.

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
use crate::device_vertices::DeviceVertices;
use crate::hits::Numbering;
use crate::mesh::Colour;
use crate::motion::MeshMotion;
use crate::{Error, Mesh, MeshId, Point, Result};
use backend::Backend;
use geom::{Animation, KeyFrame, PointBuffer, Pose, copy_in_parallel, set_each};
#[cfg(feature = "vulkan")]
use gpu_vulkan::VulkanBackend;
#[cfg(feature = "vulkan")]
use std::any::Any;
use std::ops::Range;
use std::sync::Arc;

/// A scene's meshes in one list of vertices and one of triangles.
pub(crate) struct JoinedScene {
    pub(crate) animation: Arc<Animation>,
    /// Meshes without their triangles, which the animation has.
    pub(crate) meshes: Vec<Mesh>,
    /// Index of the first vertex of each mesh, and finally the number of all vertices.
    vertices: Vec<usize>,
    pub(crate) numbering: Arc<Numbering>,
    /// Vertices of the next step, if vertices arrive while the scene is traced. Otherwise empty.
    next: PointBuffer,
    /// For each mesh, true if it has moved since the last push. Its newest vertices are then in `next`, or only on the
    /// device.
    has_moved: Vec<bool>,
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) on_device: DeviceVertices,
    /// Time of the last submission.
    pub(crate) time: f64,
    /// Time that all key-framed meshes were last blended for; `None` after an error.
    blended: Option<f64>,
}

impl JoinedScene {
    /// Joins meshes to one animation.
    pub(crate) fn of(mut meshes: Vec<Mesh>) -> Result<Self> {
        let starts = |count: fn(&Mesh) -> usize| {
            let ends = meshes.iter().scan(0, |end, mesh| {
                *end += count(mesh);
                Some(*end)
            });
            std::iter::once(0).chain(ends).collect::<Vec<_>>()
        };
        let vertices = starts(Mesh::vertex_count);
        let ids = 0..meshes.len();
        let numbering = Numbering {
            starts: starts(Mesh::triangle_count),
            ids: ids.map(|mesh| MeshId::of(&meshes, mesh)).collect(),
        };
        if let Some(&all) = vertices.last().filter(|&&all| u32::try_from(all).is_err()) {
            let why = format!("all meshes have {all} vertices, too many for 32-bit indices");
            return Err(Error::Mesh(why));
        }
        let alone = match &*meshes {
            [only] => only.animation().cloned(),
            _ => None,
        };
        let animation = match alone {
            Some(animation) => animation,
            None => {
                let all = meshes.iter().zip(&vertices).flat_map(|(mesh, &first)| {
                    let moved = move |t: &[u32; 3]| t.map(|v| v + first as u32);
                    mesh.triangles().iter().map(moved)
                });
                Arc::new(joined(&meshes, all.collect())?)
            }
        };
        for mesh in &mut meshes {
            mesh.triangles = Vec::new();
        }
        Ok(Self {
            animation,
            vertices,
            numbering: Arc::new(numbering),
            next: PointBuffer::default(),
            has_moved: vec![false; meshes.len()],
            #[cfg(any(feature = "vulkan", feature = "wgpu"))]
            on_device: DeviceVertices::default(),
            meshes,
            time: 0.0,
            blended: Some(0.0),
        })
    }

    /// Returns whether vertices arrive while the scene is traced.
    pub(crate) fn is_streamed(&self) -> bool {
        self.animation.is_streamed()
    }

    /// Returns the newest vertices that were passed to the animation, or the first key frame if no vertices arrive
    /// while the scene is traced.
    pub(crate) fn newest(&self) -> Result<KeyFrame> {
        let key = if self.is_streamed() {
            self.animation.key_count() - 1
        } else {
            0
        };
        self.animation.key(key).map_err(Error::of_reading)
    }

    /// Copies vertices from another scene, for all meshes that steps move except `replaced`. The scenes differ in this
    /// mesh only.
    pub(crate) fn copy_moved_from(&mut self, other: &[Point], replaced: usize) {
        for mesh in (0..self.meshes.len()).filter(|&mesh| mesh != replaced) {
            if self.meshes[mesh].motion.is_moved_by_steps() {
                let first = if mesh < replaced {
                    self.vertices[mesh]
                } else {
                    // The distance from the end is the same in both scenes.
                    other.len() - (self.next.len() - self.vertices[mesh])
                };
                set_each(self.vertices_of(mesh), |v| other[first + v]);
            }
        }
    }

    /// Returns a closure that splits the scene into its original meshes.
    pub(crate) fn splitter(&self) -> impl FnOnce() -> Vec<Mesh> + use<> {
        let (vertices, numbering) = (self.vertices.clone(), Arc::clone(&self.numbering));
        let (mut meshes, animation) = (self.meshes.clone(), Arc::clone(&self.animation));
        move || {
            for (i, mesh) in meshes.iter_mut().enumerate() {
                if mesh.animation().is_none() {
                    let starts = &numbering.starts;
                    let own = &animation.triangles()[starts[i]..starts[i + 1]];
                    let first = vertices[i] as u32;
                    mesh.triangles = own.iter().map(|t| t.map(|v| v - first)).collect();
                }
            }
            meshes
        }
    }

    /// Returns the colour of each triangle.
    pub(crate) fn triangle_colours(&self) -> Arc<[Colour]> {
        let starts = &self.numbering.starts;
        let counts = starts.windows(2).map(|ends| ends[1] - ends[0]);
        if let ([only], Some(&count)) = (&*self.meshes, starts.last())
            && only.colours.len() == count
        {
            return Arc::clone(&only.colours);
        }
        let each = self.meshes.iter().zip(counts);
        let of_mesh = |(mesh, count): (&Mesh, usize)| match *mesh.colours {
            [only] => vec![only; count],
            ref all => all.to_vec(),
        };
        each.flat_map(of_mesh).collect()
    }

    /// Returns the range of a mesh's vertices among all vertices.
    pub(crate) fn range_of(&self, mesh: usize) -> Range<usize> {
        self.vertices[mesh]..self.vertices[mesh + 1]
    }

    /// Returns a mesh's vertices for writing.
    pub(crate) fn vertices_of(&mut self, mesh: usize) -> &mut [Point] {
        let range = self.range_of(mesh);
        self.has_moved[mesh] = true;
        #[cfg(any(feature = "vulkan", feature = "wgpu"))]
        self.on_device.remove(mesh, &range);
        &mut self.next[range]
    }

    /// Records that only the device has the newest vertices of a mesh.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) fn set_on_device(&mut self, mesh: usize) {
        let range = self.range_of(mesh);
        self.has_moved[mesh] = true;
        self.on_device.insert(mesh, &range);
    }

    /// Starts to read the key frames that will be played next, for meshes that do not hold all of their key frames.
    pub(crate) fn look_ahead(&self, times: impl Iterator<Item = f64> + Clone) {
        for animation in self.meshes.iter().filter_map(Mesh::animation) {
            animation.look_ahead(times.clone());
        }
    }

    /// Allocates the vertices of future steps. If the device reads this memory, allocates all buffers that can be in
    /// use. A later allocation would take the driver milliseconds.
    pub(crate) fn prepare(&mut self, backend: &mut dyn Backend) -> Result<()> {
        if self.is_streamed() {
            let first = self.animation.first();
            self.next = copy_of(first, backend)?;
            // The animation keeps `KEPT` key frames. Up to two more are read by the tree builder, and up to one by a
            // copy in progress.
            let spare = match self.next {
                PointBuffer::Shared(_) => Animation::KEPT + 3,
                PointBuffer::List(_) => 0,
            };
            for _ in 0..spare {
                self.animation.add_spare_frame(copy_of(first, backend)?);
            }
        }
        Ok(())
    }

    /// Passes all changes to the animation. Returns the animation's time for a step at `time`.
    pub(crate) fn push_changes(&mut self, backend: &mut dyn Backend, time: f64) -> Result<f64> {
        self.time = time;
        if !self.is_streamed() {
            return Ok(time);
        }
        if self.blended.take() != Some(time) {
            self.blend(time)?;
        }
        self.blended = Some(time);
        if !self.has_moved.contains(&true) {
            return Ok(self.animation.end());
        }
        let last = self.newest()?;
        // `next` already has the vertices of fixed meshes.
        let is_old = |&m: &usize| !self.has_moved[m] && !self.meshes[m].motion.is_fixed();
        for mesh in (0..self.meshes.len()).filter(is_old) {
            let range = self.range_of(mesh);
            copy_in_parallel(&mut self.next[range.clone()], &last[range]);
        }
        let spare = match self.animation.spare_frame() {
            Some(spare) => spare,
            None => copy_of(&self.next, backend)?,
        };
        self.has_moved.fill(false);
        let pushed = self
            .animation
            .push(std::mem::replace(&mut self.next, spare));
        pushed.map_err(Error::of_keys)
    }

    /// Blends key-framed meshes at `time`, to the same bits as a device.
    fn blend(&mut self, time: f64) -> Result<()> {
        for mesh in 0..self.meshes.len() {
            let motion = Arc::clone(&self.meshes[mesh].motion);
            match &*motion {
                MeshMotion::Keys(keys) if keys.len() > 1 => {
                    let key_blend = Pose::at(time, keys.len());
                    let [earlier, later] =
                        [0, 1].map(|after| motion.key(key_blend.key as usize + after));
                    let blended = |v: usize| key_blend.blend(earlier[v], later[v]);
                    set_each(self.vertices_of(mesh), blended);
                }
                MeshMotion::Animated(animation) if animation.key_count() > 1 => {
                    let moment = animation.at(time).map_err(Error::of_reading)?;
                    set_each(self.vertices_of(mesh), |v| moment.vertex(v as u32));
                }
                _ => (),
            }
        }
        Ok(())
    }
}

/// Returns a copy of points, in memory that the device reads directly if it can.
fn copy_of(points: &[Point], backend: &mut dyn Backend) -> Result<PointBuffer> {
    #[cfg(feature = "vulkan")]
    {
        let backend: &mut dyn Any = backend;
        if let Some(vulkan) = backend.downcast_mut::<VulkanBackend>() {
            let allocated = vulkan.gpu_mut().point_buffer(points.len());
            let mut copy = allocated.map_err(Error::of_backend)?;
            copy_in_parallel(&mut copy, points);
            return Ok(copy);
        }
    }
    #[cfg(not(feature = "vulkan"))]
    let _ = backend;
    Ok(points.to_vec().into())
}

/// Returns whether vertices arrive while the scene is traced: from steps, or from a moving animation that is joined
/// with other meshes.
fn is_streamed(meshes: &[Mesh]) -> bool {
    let is_joined_animation = |motion: &MeshMotion| {
        let is_animated = matches!(motion, MeshMotion::Animated(_));
        is_animated && !motion.is_fixed() && meshes.len() > 1
    };
    let mut all = meshes.iter().map(|mesh| &*mesh.motion);
    all.any(|motion| motion.is_moved_by_steps() || is_joined_animation(motion))
}

/// Returns the number of key frames that joining allocates, each with the vertices of all meshes. Exception: for a
/// single mesh from an animation, which is used without a copy, returns 1.
pub(crate) fn key_count(meshes: &[Mesh]) -> usize {
    if is_streamed(meshes) {
        return 1;
    }
    let each = meshes.iter().map(|mesh| mesh.motion.key_count());
    each.max().unwrap_or(1)
}

/// Creates one animation of all meshes. `triangles` holds indices into the joined list of vertices.
fn joined(meshes: &[Mesh], triangles: Vec<[u32; 3]>) -> Result<Animation> {
    let motions = || meshes.iter().map(|mesh| &*mesh.motion);
    if is_streamed(meshes) {
        let mark = |m: &MeshMotion| std::iter::repeat_n(m.is_fixed(), m.first().len());
        let marks: Vec<bool> = motions().flat_map(mark).collect();
        let first = motions().flat_map(MeshMotion::first).copied().collect();
        return Animation::streamed(first, &marks, triangles).map_err(Error::of_keys);
    }
    let keys = key_count(meshes);
    let frame = |key| (motions().flat_map(|motion| motion.key(key)).copied()).collect();
    let frames = (0..keys).map(frame).collect();
    Animation::new(frames, triangles).map_err(Error::of_keys)
}
