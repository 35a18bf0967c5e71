//! Meshes and scenes.

use crate::motion::MeshMotion;
use crate::{Error, Point, Result};
use geom::{Animation, KeyFrameError, KeySource};
use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Triangles and their motion.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Empty if the motion is an animation, which holds the triangles.
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) motion: Arc<MeshMotion>,
    pub(crate) colours: Arc<[Colour]>,
    /// Identifies a mesh that was added to a scene; otherwise 0.
    pub(crate) number: u64,
}

/// 8-bit sRGB.
pub(crate) type Colour = [u8; 3];

/// Default colour.
const GREY: Colour = [190; 3];

impl Mesh {
    /// Creates a mesh that never moves, from vertices in any unit and three vertex indices per triangle.
    ///
    /// # Errors
    /// [`Error::Mesh`] if a vertex index is out of range. [`Error::OutOfMemory`].
    pub fn fixed(vertices: &[Point], triangles: &[[u32; 3]]) -> Result<Self> {
        let motion = MeshMotion::Keys(vec![copied(vertices)?]);
        Self::new(triangles, vertices.len(), motion)
    }

    /// Creates a fixed mesh like [`Mesh::fixed`], but from double-precision vertices, such as those of a survey or a
    /// globe.
    ///
    /// `offset` is subtracted from every vertex in double precision before rounding, so it should be near the mesh. Use
    /// the same offset for all meshes of a scene, and subtract it from the origins of rays:
    ///
    /// ```
    /// use abvh::{Device, Mesh, Query, Ray, Scene, Tracer};
    ///
    /// // Single precision has steps of 0.5 this far north.
    /// let offset = [691_608.0, 5_334_760.0, 520.0];
    /// let vertices = [
    ///     [691_608.1, 5_334_760.2, 520.5],
    ///     [691_609.1, 5_334_760.2, 520.5],
    ///     [691_608.1, 5_334_761.2, 520.5],
    /// ];
    /// let mut scene = Scene::new();
    /// scene.add(Mesh::fixed_f64(&vertices, &[[0, 1, 2]], offset)?);
    /// let mut tracer = Tracer::builder().device(Device::Cpu).build(scene)?;
    ///
    /// let eye = [691_608.3, 5_334_760.4, 600.0];
    /// let origin = std::array::from_fn(|axis| (eye[axis] - offset[axis]) as f32);
    /// let mut step = tracer.step(0.0);
    /// let query = step.trace(&[Ray::new(origin, [0.0, 0.0, -1.0])], Query::Closest)?;
    /// let step = step.submit()?;
    /// let hit = tracer.hits(step, query)?.closest(0).unwrap();
    /// assert!((hit.t - 79.5).abs() < 1e-4);
    /// # Ok::<(), abvh::Error>(())
    /// ```
    ///
    /// # Errors
    /// As for [`Mesh::fixed`].
    pub fn fixed_f64(
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
        offset: [f64; 3],
    ) -> Result<Self> {
        let round = |v: &[f64; 3]| std::array::from_fn(|axis| (v[axis] - offset[axis]) as f32);
        let rounded: Vec<Point> = vertices.iter().map(round).collect();
        Self::fixed(&rounded, triangles)
    }

    /// Creates a mesh that moves through key frames, which hold one position per vertex. Time is measured in key
    /// frames: at time `k + a`, positions are blended from key frames `k` and `k + 1` with weight `a`. Before the first
    /// and after the last key frame, the mesh does not move.
    ///
    /// # Errors
    /// [`Error::Mesh`] without key frames, if their numbers of vertices differ, or as for [`Mesh::fixed`].
    pub fn keyframes(keys: Vec<Vec<Point>>, triangles: &[[u32; 3]]) -> Result<Self> {
        let Some(vertices) = keys.first().map(Vec::len) else {
            return Err(Error::Mesh("it has no key frame".to_owned()));
        };
        if let Some(key) = keys.iter().position(|k| k.len() != vertices) {
            let found = keys[key].len();
            let why = format!("key frame {key} has {found} vertices, the first has {vertices}");
            return Err(Error::Mesh(why));
        }
        Self::new(triangles, vertices, MeshMotion::Keys(keys))
    }

    /// Creates a mesh that moves through `keys` key frames. At most about `window` key frames are in memory.
    ///
    /// `read` returns a key frame shortly before it is played, from a file or by computing it. It is called from
    /// several threads, and must return the same positions each time. All key frames are read before the first step, to
    /// find the vertices that never move. Time is measured as for [`Mesh::keyframes`].
    ///
    /// If a GPU traces and the scene has no other mesh, the GPU blends the key frames. It holds at most six of them.
    /// Otherwise the host blends them.
    ///
    /// # Errors
    /// [`Error::Mesh`] without key frames, or as for [`Mesh::fixed`]. [`Error::KeyFrame`] if the numbers of vertices
    /// differ, threads cannot be started, or `read` fails. Later steps also return it if `read` fails.
    pub fn sequence<E: Display>(
        keys: usize,
        window: usize,
        read: impl Fn(usize) -> Result<Vec<Point>, E> + Send + Sync + 'static,
        triangles: &[[u32; 3]],
    ) -> Result<Self> {
        if keys == 0 {
            return Err(Error::Mesh("it has no key frame".to_owned()));
        }
        let read = move |key: usize| read(key).map_err(|e| KeyFrameError(e.to_string()));
        let source: Arc<KeySource> = Arc::new(read);
        let first = geom::read_key(&*source, 0)
            .map_err(Error::of_reading)?
            .len();
        check_triangles(triangles, first)?;
        let animation = Animation::paged(source, keys, window, triangles.to_vec());
        let animation = animation.map_err(Error::of_reading)?;
        Ok(Self::animated(Arc::new(animation)))
    }

    /// Creates a grey mesh with the triangles and the motion of an animation.
    pub(crate) fn animated(animation: Arc<Animation>) -> Self {
        Self {
            triangles: Vec::new(),
            motion: Arc::new(MeshMotion::Animated(animation)),
            colours: Arc::new([GREY]),
            number: 0,
        }
    }

    /// Creates a mesh whose vertices are passed to each step: see [`Step::vertices`](crate::Step::vertices). Its
    /// initial positions are `rest`.
    ///
    /// # Errors
    /// As for [`Mesh::fixed`].
    pub fn streamed(rest: &[Point], triangles: &[[u32; 3]]) -> Result<Self> {
        Self::new(triangles, rest.len(), MeshMotion::Streamed(copied(rest)?))
    }

    /// Creates a mesh of rigid parts. `part_of_vertex` holds the part index of each vertex. Steps pass a matrix for
    /// each part: see [`Step::poses`](crate::Step::poses). The initial positions are `rest`.
    ///
    /// # Errors
    /// As for [`Mesh::fixed`], or if `part_of_vertex` does not have one entry per vertex.
    pub fn rigid(rest: &[Point], triangles: &[[u32; 3]], part_of_vertex: &[u32]) -> Result<Self> {
        if part_of_vertex.len() != rest.len() {
            let (parts, vertices) = (part_of_vertex.len(), rest.len());
            let why = format!("{parts} part indices were passed for {vertices} vertices");
            return Err(Error::Mesh(why));
        }
        let last = part_of_vertex.iter().max();
        let motion = MeshMotion::Rigid {
            rest: copied(rest)?,
            part_of_vertex: copied(part_of_vertex)?,
            parts: last.map_or(0, |&part| part as usize + 1),
        };
        Self::new(triangles, rest.len(), motion)
    }

    fn new(triangles: &[[u32; 3]], vertices: usize, motion: MeshMotion) -> Result<Self> {
        check_triangles(triangles, vertices)?;
        Ok(Self {
            triangles: copied(triangles)?,
            motion: Arc::new(motion),
            colours: Arc::new([GREY]),
            number: 0,
        })
    }

    /// Sets the colours for [pictures](crate::Step::render): 8-bit sRGB, one per triangle, or one for all. The default
    /// is grey.
    ///
    /// # Errors
    /// [`Error::Mesh`] for any other number of colours.
    pub fn with_colours(mut self, colours: &[[u8; 3]]) -> Result<Self> {
        let (found, triangles) = (colours.len(), self.triangle_count());
        if found != 1 && found != triangles {
            let why = format!("{found} colours were passed for {triangles} triangles");
            return Err(Error::Mesh(why));
        }
        self.colours = colours.into();
        Ok(self)
    }

    /// Opens a mesh file (`.obj`, `.ply`, `.gltf` or `.glb`) with its motion and colours. `name` may also be a folder
    /// or a pattern of files, each of which is a key frame, or `demo:NAME` for a generated mesh. Key frames that take
    /// much memory are read while they are played.
    ///
    /// # Errors
    /// [`Error::KeyFrame`], with the file and the position in it. [`Error::Unsupported`] if no threads can be started.
    #[cfg(feature = "files")]
    pub fn open(name: &str) -> Result<Self> {
        let open = || scene::open(name, &scene::SceneOptions::default());
        let threads = rayon::ThreadPoolBuilder::new().num_threads(geom::parallelism());
        // Opening may wait for the threads that read key frames. These may need the pool that all calls of the library
        // share (`geom::in_parallel`). So opening runs in a pool of its own, to avoid a deadlock.
        let found = match geom::start_library_pool(threads) {
            Ok(pool) => geom::run_in(&pool, open),
            Err(e) => return Err(Error::Unsupported(format!("no threads to read files: {e}"))),
        };
        let found = found.map_err(|e| Error::KeyFrame(e.to_string()))?;
        Ok(Self::of_scene(&found))
    }

    #[cfg(feature = "files")]
    fn of_scene(scene: &scene::Scene) -> Self {
        Self {
            colours: Arc::clone(&scene.colours),
            ..Self::animated(Arc::clone(&scene.animation))
        }
    }

    /// Returns the number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.motion.first().len()
    }

    /// Returns the number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles().len()
    }

    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        self.animation().map_or(&self.triangles, |a| a.triangles())
    }

    /// Returns the animation that has the triangles, if the mesh was created from one.
    pub(crate) fn animation(&self) -> Option<&Arc<Animation>> {
        match &*self.motion {
            MeshMotion::Animated(animation) => Some(animation),
            _ => None,
        }
    }
}

/// Converts a scene that was read with other options than those of [`Mesh::open`].
#[cfg(all(feature = "files", feature = "unstable"))]
impl From<&scene::Scene> for Mesh {
    fn from(scene: &scene::Scene) -> Self {
        Self::of_scene(scene)
    }
}

/// Copies a slice. Returns [`Error::OutOfMemory`] if the allocation fails.
fn copied<T: Copy>(from: &[T]) -> Result<Vec<T>> {
    let mut copy = Vec::new();
    let reserved = host::reserve(&mut copy, from.len());
    reserved.map_err(|e| Error::OutOfMemory(format!("no memory for a mesh: {e}")))?;
    copy.extend_from_slice(from);
    Ok(copy)
}

fn check_triangles(triangles: &[[u32; 3]], vertices: usize) -> Result<()> {
    let outside = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= vertices);
    let Some(triangle) = triangles.iter().position(outside) else {
        return Ok(());
    };
    let [a, b, c] = triangles[triangle];
    let why =
        format!("triangle {triangle} uses vertices {a}, {b} and {c}, but there are {vertices}");
    Err(Error::Mesh(why))
}

/// Identifies a mesh of a scene. It does not change while the scene is traced, even if meshes are
/// [replaced](crate::Tracer::replace).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MeshId {
    number: u64,
    index: u32,
}

impl MeshId {
    /// Returns the identifier of mesh `index` of a scene.
    pub(crate) fn of(meshes: &[Mesh], index: usize) -> Self {
        Self {
            number: meshes[index].number,
            index: index as u32,
        }
    }

    /// Returns the index of the mesh, in the order in which meshes were added to the scene.
    #[must_use]
    pub fn index(self) -> usize {
        self.index as usize
    }

    /// Returns the index of the mesh, or [`Error::ForeignMesh`] if it is not one of `meshes`.
    pub(crate) fn within(self, meshes: &[Mesh]) -> Result<usize> {
        let found = meshes.get(self.index());
        let is_it = found.is_some_and(|mesh| mesh.number == self.number);
        is_it
            .then_some(self.index())
            .ok_or(Error::ForeignMesh(self))
    }
}

/// Meshes that are traced together. A clone has the same meshes with the same identifiers.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub(crate) meshes: Vec<Mesh>,
}

/// Number of meshes added to scenes so far.
static ADDED: AtomicU64 = AtomicU64::new(0);

impl Scene {
    /// Creates an empty scene.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a mesh. Returns the identifier that steps and hits use for it.
    pub fn add(&mut self, mesh: Mesh) -> MeshId {
        let number = 1 + ADDED.fetch_add(1, Ordering::Relaxed);
        self.meshes.push(Mesh { number, ..mesh });
        MeshId::of(&self.meshes, self.meshes.len() - 1)
    }
}
