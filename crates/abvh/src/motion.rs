//! How meshes move, and where all of a scene's vertices are at one moment.

#[cfg(any(feature = "vulkan", feature = "wgpu"))]
use crate::device_vertices::DeviceVertices;
use crate::hits::Numbering;
use crate::mesh::Colour;
use crate::vertices::{copy, set};
use crate::{Error, Mesh, MeshId, Point, Result};
use backend::Backend;
use geom::{Animation, KeyFrame, PointBuffer, Pose};
use std::ops::Range;
use std::sync::Arc;

/// Three rows of an affine map: a vertex `v` goes to `m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2] + m[i][3]` on axis `i`,
/// added from left to right, each operation rounded once.
pub type Matrix = [[f32; 4]; 3];

/// How a mesh moves.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    /// One at least; with no other it is fixed.
    Keys(Vec<Vec<Point>>),
    /// Key frames that may be read while they are played, with triangles.
    Animated(Arc<Animation>),
    Streamed(Vec<Point>),
    Rigid {
        rest: Vec<Point>,
        part_of_vertex: Vec<u32>,
        parts: usize,
    },
}

impl Motion {
    /// Where its vertices stand at first.
    pub(crate) fn first(&self) -> &[Point] {
        match self {
            Self::Keys(keys) => &keys[0],
            Self::Animated(animation) => animation.first(),
            Self::Streamed(rest) | Self::Rigid { rest, .. } => rest,
        }
    }

    /// Key frames that an animation of all meshes takes of it.
    pub(crate) fn key_count(&self) -> usize {
        match self {
            Self::Keys(keys) => keys.len(),
            _ => 1,
        }
    }

    /// One of them; the last one after that.
    fn key(&self, key: usize) -> &[Point] {
        match self {
            Self::Keys(keys) => &keys[key.min(keys.len() - 1)],
            _ => self.first(),
        }
    }

    pub(crate) fn is_fixed(&self) -> bool {
        match self {
            Self::Keys(keys) => keys.len() == 1,
            Self::Animated(animation) => animation.key_count() == 1,
            Self::Streamed(_) | Self::Rigid { .. } => false,
        }
    }

    /// Whether steps say where it goes.
    fn is_live(&self) -> bool {
        matches!(self, Self::Streamed(_) | Self::Rigid { .. })
    }
}

/// A scene's meshes in one list of vertices and one of triangles.
pub(crate) struct Joined {
    pub(crate) animation: Arc<Animation>,
    /// Without their triangles, which the animation has.
    pub(crate) meshes: Vec<Mesh>,
    /// The first vertex of each mesh; one more entry ends them.
    vertices: Vec<usize>,
    pub(crate) numbering: Arc<Numbering>,
    /// Where all vertices are going to be, if anything arrives while the scene is traced; else empty.
    next: PointBuffer,
    /// Meshes whose vertices in there are the newest.
    is_fresh: Vec<bool>,
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) on_device: DeviceVertices,
    /// Whether the animation knows them all.
    is_told: bool,
    /// The time of the last step.
    pub(crate) time: f64,
    /// What key-framed meshes were blended for, if all of them were.
    blended: Option<f64>,
}

impl Joined {
    /// Joins meshes, and makes an animation of them.
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
            let why = format!("all meshes have {all} vertices, more than can be numbered");
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
            is_fresh: vec![true; meshes.len()],
            #[cfg(any(feature = "vulkan", feature = "wgpu"))]
            on_device: DeviceVertices::default(),
            meshes,
            is_told: true,
            time: 0.0,
            blended: Some(0.0),
        })
    }

    /// Whether vertices arrive while the scene is traced.
    pub(crate) fn is_arriving(&self) -> bool {
        self.animation.is_arriving()
    }

    /// Where meshes stand, but for what no query has seen yet.
    pub(crate) fn newest(&self) -> Result<KeyFrame> {
        let last = self.animation.key_count() - 1;
        self.animation.key(last).map_err(Error::of_reading)
    }

    /// Puts meshes that steps move, but for one, where they stand in another scene, which differs by that one.
    pub(crate) fn move_to(&mut self, other: &[Point], but: usize) {
        for mesh in (0..self.meshes.len()).filter(|&mesh| mesh != but) {
            if self.meshes[mesh].motion.is_live() {
                let first = match mesh < but {
                    true => self.vertices[mesh],
                    // As far from the end.
                    false => other.len() - (self.next.len() - self.vertices[mesh]),
                };
                set(self.vertices_of(mesh), |v| other[first + v]);
            }
        }
    }

    /// Takes the scene apart into the meshes that it was made of, once that is called for.
    pub(crate) fn parts(&self) -> impl FnOnce() -> Vec<Mesh> + use<> {
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

    /// One colour a triangle.
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

    /// Where a mesh's vertices lie among all.
    pub(crate) fn range_of(&self, mesh: usize) -> Range<usize> {
        self.vertices[mesh]..self.vertices[mesh + 1]
    }

    /// A mesh's vertices, to be moved.
    pub(crate) fn vertices_of(&mut self, mesh: usize) -> &mut [Point] {
        let range = self.range_of(mesh);
        (self.is_told, self.is_fresh[mesh]) = (false, true);
        #[cfg(any(feature = "vulkan", feature = "wgpu"))]
        self.on_device.leave(mesh, &range);
        &mut self.next[range]
    }

    /// A mesh's vertices came to the device alone.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) fn is_on_device(&mut self, mesh: usize) {
        let range = self.range_of(mesh);
        (self.is_told, self.is_fresh[mesh]) = (false, true);
        self.on_device.come(mesh, &range);
    }

    /// Has key frames be read that will be played next, where not all are held.
    pub(crate) fn look_ahead(&self, times: impl Iterator<Item = f64> + Clone) {
        for animation in self.meshes.iter().filter_map(Mesh::animation) {
            animation.look_ahead(times.clone());
        }
    }

    /// Has steps to come prepared where the device reads them. Memory for as many as are held at a time is made at once: a
    /// driver takes milliseconds for it.
    pub(crate) fn prepare(&mut self, backend: &mut dyn Backend) -> Result<()> {
        if self.is_arriving() {
            let first = self.animation.first();
            self.next = copy_of(first, backend)?;
            // Two may be read by who builds a tree, one by a copy under way.
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

    /// The time in the animation at which a step at `time` stands, with all that was said of it.
    pub(crate) fn tell(&mut self, backend: &mut dyn Backend, time: f64) -> Result<f64> {
        self.time = time;
        if !self.is_arriving() {
            return Ok(time);
        }
        if self.blended.take() != Some(time) {
            self.blend(time)?;
        }
        self.blended = Some(time);
        if std::mem::replace(&mut self.is_told, true) {
            return Ok(self.animation.end());
        }
        let last = self.newest()?;
        for mesh in (0..self.meshes.len()).filter(|&mesh| !self.is_fresh[mesh]) {
            let range = self.range_of(mesh);
            copy(&mut self.next[range.clone()], &last[range]);
        }
        // A frame that was dropped has meshes that never move where they are.
        let spare = match self.animation.spare_frame() {
            Some(spare) => spare,
            None => copy_of(&self.next, backend)?,
        };
        self.is_fresh = self.meshes.iter().map(|m| m.motion.is_fixed()).collect();
        let pushed = self
            .animation
            .push(std::mem::replace(&mut self.next, spare));
        pushed.map_err(Error::of_keys)
    }

    /// Brings key-framed meshes to `time`, with the bits that a device would blend.
    fn blend(&mut self, time: f64) -> Result<()> {
        for mesh in 0..self.meshes.len() {
            let motion = Arc::clone(&self.meshes[mesh].motion);
            match &*motion {
                Motion::Keys(keys) if keys.len() > 1 => {
                    let pose = Pose::at(time, keys.len());
                    let [earlier, later] =
                        [0, 1].map(|after| motion.key(pose.key as usize + after));
                    set(self.vertices_of(mesh), |v| pose.blend(earlier[v], later[v]));
                }
                Motion::Animated(animation) if animation.key_count() > 1 => {
                    let moment = animation.at(time).map_err(Error::of_reading)?;
                    set(self.vertices_of(mesh), |v| moment.vertex(v as u32));
                }
                _ => (),
            }
        }
        Ok(())
    }
}

fn copy_of(points: &[Point], backend: &mut dyn Backend) -> Result<PointBuffer> {
    let made = backend.point_buffer(points.len());
    let mut made = made.map_err(Error::of_backend)?;
    copy(&mut made, points);
    Ok(made)
}

/// Whether vertices arrive while the scene is traced: steps bring them, or they are read beside those of other meshes.
fn is_live(meshes: &[Mesh]) -> bool {
    let is_read = |motion: &Motion| {
        let is_animated = matches!(motion, Motion::Animated(_));
        is_animated && !motion.is_fixed() && meshes.len() > 1
    };
    let mut all = meshes.iter().map(|mesh| &*mesh.motion);
    all.any(|motion| motion.is_live() || is_read(motion))
}

/// One animation of all meshes, over their triangles, whose vertices are numbered through all.
fn joined(meshes: &[Mesh], triangles: Vec<[u32; 3]>) -> Result<Animation> {
    let motions = || meshes.iter().map(|mesh| &*mesh.motion);
    if is_live(meshes) {
        let mark = |m: &Motion| std::iter::repeat_n(m.is_fixed(), m.first().len());
        let marks: Vec<bool> = motions().flat_map(mark).collect();
        let first = motions().flat_map(Motion::first).copied().collect();
        return Animation::live(first, &marks, triangles).map_err(Error::of_keys);
    }
    let keys = motions().map(Motion::key_count).max().unwrap_or(1);
    let frame = |key| (motions().flat_map(|motion| motion.key(key)).copied()).collect();
    let frames = (0..keys).map(frame).collect();
    Animation::new(frames, triangles).map_err(Error::of_keys)
}

/// Where a matrix brings a vertex.
pub(crate) fn moved(m: &Matrix, v: Point) -> Point {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3])
}
