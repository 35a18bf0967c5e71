//! How meshes move, and where all of a scene's vertices are at one moment.

use crate::mesh::Colour;
use crate::{Error, Mesh, Point, Result};
use backend::Backend;
use geom::{Animation, KeyFrame, PointBuffer, Pose};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Three rows of an affine map: a vertex `v` goes to `m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2] + m[i][3]` on axis `i`,
/// added from left to right, each operation rounded once.
pub type Matrix = [[f32; 4]; 3];

/// How a mesh moves.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    Fixed(Vec<Point>),
    /// One at least.
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
            Self::Fixed(rest) | Self::Streamed(rest) | Self::Rigid { rest, .. } => rest,
        }
    }

    /// Key frames that an animation of all meshes takes of it.
    fn key_count(&self) -> usize {
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
            Self::Fixed(_) => true,
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

/// Where all meshes of a scene stand.
pub(crate) struct CurrentVertices {
    newest: KeyFrame,
    /// The first vertex of each mesh.
    starts: Vec<usize>,
}

impl CurrentVertices {
    /// A copy of its own: steps to come use that memory again.
    pub(crate) fn detached(self) -> Self {
        let newest = Arc::new(self.newest.to_vec().into());
        Self { newest, ..self }
    }
}

/// A scene's meshes in one list of vertices and one of triangles.
pub(crate) struct Joined {
    pub(crate) motions: Vec<Arc<Motion>>,
    /// Of each mesh: one for all its triangles, or one each.
    colours: Vec<Arc<[Colour]>>,
    /// The first vertex of each mesh; one more entry ends them.
    vertices: Vec<usize>,
    /// Likewise of triangles.
    triangles: Vec<usize>,
    /// Where all vertices are going to be, if anything arrives while the scene is traced; else empty.
    next: PointBuffer,
    /// Meshes whose vertices in there are the newest.
    is_fresh: Vec<bool>,
    /// Where vertices came to lie there that a device had of its own before.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) returned: Vec<Range<usize>>,
    /// Whether the animation knows them all.
    is_told: bool,
    /// The time of the last step.
    pub(crate) time: f64,
    /// What key-framed meshes were blended for, if all of them were.
    blended: Option<f64>,
}

impl Joined {
    /// Joins meshes, and makes an animation of them.
    pub(crate) fn of(meshes: Vec<Mesh>) -> Result<(Self, Arc<Animation>)> {
        let starts = |count: fn(&Mesh) -> usize| {
            let ends = meshes.iter().scan(0, |end, mesh| {
                *end += count(mesh);
                Some(*end)
            });
            std::iter::once(0).chain(ends).collect::<Vec<_>>()
        };
        let vertices = starts(Mesh::vertex_count);
        let triangles = starts(Mesh::triangle_count);
        if let Some(&all) = vertices.last().filter(|&&all| u32::try_from(all).is_err()) {
            let why = format!("all meshes have {all} vertices, more than can be numbered");
            return Err(Error::Mesh(why));
        }
        let all = meshes.iter().zip(&vertices).flat_map(|(mesh, &first)| {
            let moved = move |t: &[u32; 3]| t.map(|v| v + first as u32);
            mesh.triangles().iter().map(moved)
        });
        let alone = match &*meshes {
            [only] => only.animation().cloned(),
            _ => None,
        };
        let all = match alone {
            Some(_) => Vec::new(),
            None => all.collect(),
        };
        let looks = meshes.into_iter().map(|mesh| (mesh.motion, mesh.colours));
        let (motions, colours): (Vec<_>, Vec<_>) = looks.unzip();
        let mut joined = Self {
            vertices,
            triangles,
            next: PointBuffer::default(),
            is_fresh: vec![true; motions.len()],
            #[cfg(any(feature = "vulkan", feature = "wgpu"))]
            returned: Vec::new(),
            motions,
            colours,
            is_told: true,
            time: 0.0,
            blended: Some(0.0),
        };
        let animation = match alone {
            Some(animation) => animation,
            None if joined.is_live() => Arc::new(joined.live(all)?),
            None => Arc::new(joined.keyed(all)?),
        };
        Ok((joined, animation))
    }

    fn keyed(&self, triangles: Vec<[u32; 3]>) -> Result<Animation> {
        let counts = self.motions.iter().map(|motion| motion.key_count());
        let frame = |key: usize| {
            let each = self.motions.iter().flat_map(|motion| motion.key(key));
            each.copied().collect::<Vec<_>>()
        };
        let frames = (0..counts.max().unwrap_or(1)).map(frame);
        Animation::new(frames.collect(), triangles).map_err(Error::of_keys)
    }

    fn live(&mut self, triangles: Vec<[u32; 3]>) -> Result<Animation> {
        let all = self.motions.iter();
        let marks = all.flat_map(|m| std::iter::repeat_n(m.is_fixed(), m.first().len()));
        let marks: Vec<bool> = marks.collect();
        let all = self.motions.iter();
        let first: Vec<Point> = all.flat_map(|m| m.first()).copied().collect();
        Animation::live(first, &marks, triangles).map_err(Error::of_keys)
    }

    /// Whether vertices arrive while the scene is traced: steps bring them, or they are read beside those of other meshes.
    pub(crate) fn is_live(&self) -> bool {
        let is_alone = self.motions.len() == 1;
        let is_read = |motion: &Motion| {
            let is_animated = matches!(motion, Motion::Animated(_));
            is_animated && !motion.is_fixed() && !is_alone
        };
        let mut all = self.motions.iter();
        all.any(|motion| motion.is_live() || is_read(motion))
    }

    /// Where meshes stand, but for what no query has seen yet.
    pub(crate) fn current_vertices(&self, animation: &Animation) -> Result<CurrentVertices> {
        let newest = animation.key(animation.key_count() - 1);
        Ok(CurrentVertices {
            newest: newest.map_err(Error::of_reading)?,
            starts: self.vertices.clone(),
        })
    }

    /// Puts meshes that steps move, but for one, where they stand in another scene.
    pub(crate) fn move_to(&mut self, other: &CurrentVertices, but: usize) {
        for mesh in (0..self.motions.len()).filter(|&mesh| mesh != but) {
            if self.motions[mesh].is_live() {
                let from = &other.newest[other.starts[mesh]..];
                set(self.vertices_of(mesh), |v| from[v]);
            }
        }
    }

    /// Takes the scene apart into the meshes that it was made of, once that is called for.
    pub(crate) fn parts(&self, animation: &Arc<Animation>) -> impl FnOnce() -> Vec<Mesh> + use<> {
        let [vertices, triangles] = [&self.vertices, &self.triangles].map(Vec::clone);
        let looks = self.motions.iter().cloned().zip(self.colours.clone());
        let (looks, animation) = (looks.collect::<Vec<_>>(), Arc::clone(animation));
        move || {
            let mesh = |(i, (motion, colours)): (usize, (Arc<Motion>, Arc<[Colour]>))| {
                let first = vertices[i] as u32;
                let own = &animation.triangles()[triangles[i]..triangles[i + 1]];
                let triangles = match &*motion {
                    Motion::Animated(_) => Vec::new(),
                    _ => own.iter().map(|t| t.map(|v| v - first)).collect(),
                };
                Mesh {
                    triangles,
                    motion,
                    colours,
                }
            };
            looks.into_iter().enumerate().map(mesh).collect()
        }
    }

    /// One colour a triangle.
    pub(crate) fn triangle_colours(&self) -> Arc<[Colour]> {
        let counts = self.triangles.windows(2).map(|ends| ends[1] - ends[0]);
        if let ([only], Some(&count)) = (&*self.colours, self.triangles.last())
            && only.len() == count
        {
            return Arc::clone(only);
        }
        let each = self.colours.iter().zip(counts);
        let of_mesh = |(all, count): (&Arc<[Colour]>, usize)| match **all {
            [only] => vec![only; count],
            _ => all.to_vec(),
        };
        each.flat_map(of_mesh).collect()
    }

    /// The mesh of a triangle, and its number there.
    pub(crate) fn mesh_of(&self, triangle: u32) -> (usize, u32) {
        let triangle = triangle as usize;
        let mesh = self.triangles.partition_point(|&first| first <= triangle) - 1;
        (mesh, (triangle - self.triangles[mesh]) as u32)
    }

    #[cfg(feature = "wgpu")]
    pub(crate) fn first_triangle(&self, mesh: usize) -> u32 {
        self.triangles[mesh] as u32
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
        self.returned.push(range.clone());
        &mut self.next[range]
    }

    /// A mesh's vertices came to the device alone.
    #[cfg(any(feature = "vulkan", feature = "wgpu"))]
    pub(crate) fn is_on_device(&mut self, mesh: usize) {
        let range = self.range_of(mesh);
        (self.is_told, self.is_fresh[mesh]) = (false, true);
        self.returned.retain(|other| *other != range);
    }

    /// Has key frames be read that will be played next, where not all are held.
    pub(crate) fn look_ahead(&self, times: impl Iterator<Item = f64> + Clone) {
        for motion in &self.motions {
            if let Motion::Animated(animation) = &**motion {
                animation.look_ahead(times.clone());
            }
        }
    }

    /// Has steps to come prepared where the device reads them.
    pub(crate) fn prepare(
        &mut self,
        animation: &Animation,
        backend: &mut dyn Backend,
    ) -> Result<()> {
        if self.is_live() {
            let made = backend.point_buffer(animation.vertex_count());
            self.next = made.map_err(Error::of_backend)?;
            self.next.copy_from_slice(animation.first());
        }
        Ok(())
    }

    /// Sets a rigid mesh's matrices, of which there must be one a part.
    pub(crate) fn transform(&mut self, mesh: usize, matrices: &[Matrix]) {
        let motion = Arc::clone(&self.motions[mesh]);
        if let Motion::Rigid {
            rest,
            part_of_vertex,
            ..
        } = &*motion
        {
            let matrix = |v: usize| &matrices[part_of_vertex[v] as usize];
            set(self.vertices_of(mesh), |v| moved(matrix(v), rest[v]));
        }
    }

    /// The time in the animation at which a step at `time` stands, with all that was said of it.
    pub(crate) fn tell(
        &mut self,
        animation: &Animation,
        backend: &mut dyn Backend,
        time: f64,
    ) -> Result<f64> {
        self.time = time;
        if !self.is_live() {
            return Ok(time);
        }
        if self.blended.take() != Some(time) {
            self.blend(time)?;
        }
        self.blended = Some(time);
        if std::mem::replace(&mut self.is_told, true) {
            return Ok(animation.end());
        }
        let last = animation.at(animation.end()).map_err(Error::of_reading)?;
        let [last, _] = last.key_frames();
        for mesh in (0..self.motions.len()).filter(|&mesh| !self.is_fresh[mesh]) {
            let range = self.range_of(mesh);
            self.next[range.clone()].copy_from_slice(&last[range]);
        }
        // A frame that was dropped has meshes that never move where they are.
        let spare = match animation.spare_frame() {
            Some(spare) => spare,
            None => {
                let new = backend.point_buffer(self.next.len());
                let mut new = new.map_err(Error::of_backend)?;
                new.copy_from_slice(&self.next);
                new
            }
        };
        self.is_fresh = self.motions.iter().map(|m| m.is_fixed()).collect();
        let pushed = animation.push(std::mem::replace(&mut self.next, spare));
        pushed.map_err(Error::of_keys)
    }

    /// Brings key-framed meshes to `time`, with the bits that a device would blend.
    fn blend(&mut self, time: f64) -> Result<()> {
        for mesh in 0..self.motions.len() {
            let motion = Arc::clone(&self.motions[mesh]);
            match &*motion {
                motion if motion.is_fixed() => (),
                Motion::Keys(keys) => {
                    let pose = Pose::at(time, keys.len());
                    let [earlier, later] =
                        [0, 1].map(|after| motion.key(pose.key as usize + after));
                    set(self.vertices_of(mesh), |v| pose.blend(earlier[v], later[v]));
                }
                Motion::Animated(animation) => {
                    let moment = animation.at(time).map_err(Error::of_reading)?;
                    set(self.vertices_of(mesh), |v| moment.vertex(v as u32));
                }
                Motion::Fixed(_) | Motion::Streamed(_) | Motion::Rigid { .. } => (),
            }
        }
        Ok(())
    }
}

/// Vertices that the calling thread sets before a busy pool would take them up.
const FEW: usize = 1 << 16;

/// Sets each vertex by its number, by all threads where there are many.
fn set(to: &mut [Point], of: impl Fn(usize) -> Point + Sync) {
    let one = |(v, to): (usize, &mut Point)| *to = of(v);
    match to.len() <= FEW {
        true => to.iter_mut().enumerate().for_each(one),
        false => {
            let all = to.par_iter_mut().enumerate();
            all.with_min_len(FEW / 4).for_each(one);
        }
    }
}

fn moved(m: &Matrix, v: Point) -> Point {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3])
}
