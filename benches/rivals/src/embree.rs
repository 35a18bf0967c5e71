//! Embree 4 (Wald, Woop, Benthin, Johnson, Ernst 2014) through its C interface.
//!
//! The library `libembree4` is loaded at run time from where the system finds libraries, such as a folder in
//! `LD_LIBRARY_PATH`. The Python wheel `embreex` contains the library under another name. To use it, link it as
//! `libembree4.so.4` in the same folder.

mod raw;
mod scene;

use crate::{Rival, RivalName, TreeUpdate};
use backend::{
    AdapterInfo, Arithmetic, BackendError, Capabilities, Device, DeviceKind, FrameReport, Hits,
    Rays, Result, StageTimes, TreeFormat,
};
use cpu_ref::shadow::Light;
use geom::{Animation, Hit, Moment, Point, Pose, Ray};
use raw::{Handle, functions};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use scene::EmbreeScene;
use std::ptr::null;
use std::sync::Arc;
use std::time::Instant;

/// Rays that one task traces, and vertices that one task interpolates.
const TASK: usize = 512;

/// Embree with single rays, traced in parallel tasks.
pub struct Embree {
    device: Device,
    pool: ThreadPool,
    loaded: Option<Loaded>,
    hits: Hits,
}

/// A loaded animation. The first frame creates its Embree scene.
struct Loaded {
    animation: Arc<Animation>,
    tree_update: TreeUpdate,
    scene: Option<EmbreeScene>,
    /// Pose of the scene; `None` before the first frame and after a failed one.
    pose: Option<Pose>,
}

/// Returns the only adapter, the host.
///
/// # Errors
/// The library is absent or incomplete.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    let driver = version()?;
    Ok(vec![AdapterInfo {
        index: 0,
        name: "host".to_owned(),
        driver,
        kind: DeviceKind::Cpu,
        limits: vec![("threads", host::cores().to_string())],
    }])
}

/// Returns the version of the library.
fn version() -> Result<String> {
    /// `RTC_DEVICE_PROPERTY_VERSION`. Its value is `10_000 * major + 100 * minor + patch`.
    const VERSION: u32 = 0;
    let functions = functions().map_err(BackendError::NoDevice)?;
    // SAFETY: a device without a configuration is made and released here.
    let version = unsafe {
        let device: Handle = (functions.new_device)(null());
        let version = (functions.get_device_property)(device, VERSION);
        (functions.release_device)(device);
        version
    };
    let (major, minor, patch) = (version / 10_000, version / 100 % 100, version % 100);
    Ok(format!("Embree {major}.{minor}.{patch}"))
}

impl Embree {
    /// Opens the library, to use `threads` threads.
    ///
    /// # Errors
    /// The library is absent or incomplete, or threads cannot be started.
    pub fn new(threads: usize) -> Result<Self> {
        let driver = version()?;
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|e| BackendError::NoDevice(e.to_string()))?;
        let backend = RivalName::Embree.name();
        let device = Device {
            backend,
            adapter: "host".to_owned(),
            driver,
            kind: DeviceKind::Cpu,
            threads,
            arithmetic: Arithmetic::IEEE,
            capabilities: Capabilities::minimal(backend, TreeFormat::default()),
        };
        Ok(Self {
            device,
            pool,
            loaded: None,
            hits: Hits::default(),
        })
    }
}

impl Rival for Embree {
    fn device(&self) -> &Device {
        &self.device
    }

    fn load(&mut self, animation: Arc<Animation>, tree_update: TreeUpdate) -> Result<()> {
        self.loaded = Some(Loaded {
            animation,
            tree_update,
            scene: None,
            pose: None,
        });
        Ok(())
    }

    fn frame(&mut self, pose: Pose, rays: Rays<'_>, light: Option<Point>) -> Result<FrameReport> {
        let loaded = self.loaded.as_mut().expect("a scene was loaded");
        let mut report = FrameReport::default();
        if loaded.pose != Some(pose) {
            loaded.move_to(pose, &self.pool, &mut report.times)?;
        }
        let scene = loaded.scene.as_ref().expect("it is built");
        let moment = loaded.animation.moment(pose)?;
        let begun = Instant::now();
        let tracer = Tracer {
            scene,
            moment: &moment,
            rays,
            light: light.map(|at| offset_light(&loaded.animation, pose, at)),
        };
        let hits = &mut self.hits;
        (report.hits, report.blocked) = self.pool.install(|| tracer.trace(hits));
        let times = &mut report.times;
        times.trace_primary_ms = Some(ms_since(begun));
        let stages = [times.interpolate_ms, times.refit_ms, times.trace_primary_ms];
        times.device_ms = stages.into_iter().flatten().sum();
        Ok(report)
    }

    fn hits(&mut self) -> Result<&Hits> {
        Ok(&self.hits)
    }
}

impl Loaded {
    /// Builds the scene at a pose, or moves it to the pose.
    fn move_to(&mut self, pose: Pose, pool: &ThreadPool, times: &mut StageTimes) -> Result<()> {
        self.pose = None;
        let moment = self.animation.moment(pose)?;
        let begun = Instant::now();
        let interpolate = |vertices: &mut [Point]| {
            let tasks = vertices.par_chunks_mut(TASK).enumerate();
            tasks.for_each(|(task, vertices)| {
                for (i, vertex) in (task * TASK..).zip(vertices) {
                    *vertex = moment.vertex(i as u32);
                }
            });
            Some(ms_since(begun))
        };
        let begun_tree;
        if let Some(scene) = &mut self.scene {
            times.interpolate_ms = pool.install(|| interpolate(scene.vertices()));
            begun_tree = Instant::now();
            scene.update_tree();
        } else {
            let mut vertices = vec![[0.0; 3]; self.animation.vertex_count()];
            times.interpolate_ms = pool.install(|| interpolate(&mut vertices));
            begun_tree = Instant::now();
            let (triangles, threads) = (self.animation.triangles(), pool.current_num_threads());
            let scene = EmbreeScene::new(&vertices, triangles, threads, self.tree_update);
            self.scene = Some(scene.map_err(BackendError::NoDevice)?);
        }
        times.refit_ms = Some(ms_since(begun_tree));
        self.pose = Some(pose);
        Ok(())
    }
}

fn ms_since(begun: Instant) -> f64 {
    begun.elapsed().as_secs_f64() * 1e3
}

/// Returns the light for shadow rays. Their origins are offset from the hits by the same rule as ours, but with the box
/// of all key frames instead of the frame's box. The offset grows with the box's longest edge, up to a limit:
/// [`geom::CoordinateRange::clearance`].
///
/// Our kernels trace in scaled units, but Embree in scene units. So both positions of the light are equal here.
fn offset_light(animation: &Animation, pose: Pose, at: Point) -> Light {
    let [x, y, z] = animation.bounds().extent();
    Light {
        scaled_position: at,
        position: at,
        extent: x.max(y).max(z).min(animation.range(pose).clearance),
    }
}

/// Rays through a scene at a moment.
struct Tracer<'a> {
    scene: &'a EmbreeScene,
    moment: &'a Moment<'a>,
    rays: Rays<'a>,
    light: Option<Light>,
}

impl Tracer<'_> {
    /// Traces all rays, and returns how many hit and how many hits are in shadow.
    fn trace(&self, hits: &mut Hits) -> (u64, u64) {
        let rays = self.rays.count();
        hits.closest.resize(rays, Hit::MISS);
        let marks = if self.light.is_some() { rays } else { 0 };
        hits.blocked.resize(marks, 0);
        let sum = |a: (u64, u64), b: (u64, u64)| (a.0 + b.0, a.1 + b.1);
        let closest = hits.closest.par_chunks_mut(TASK).enumerate();
        if self.light.is_none() {
            let found = closest.map(|(task, hits)| self.find(task * TASK, hits, &mut []));
            return found.reduce(|| (0, 0), sum);
        }
        let both = closest.zip(hits.blocked.par_chunks_mut(TASK));
        let found = both.map(|((task, hits), marks)| self.find(task * TASK, hits, marks));
        found.reduce(|| (0, 0), sum)
    }

    /// Finds the closest hits of the rays from `first` on. Unless `marks` is empty, also marks the hits in shadow.
    /// Returns the number of hits and of hits in shadow.
    fn find(&self, first: usize, hits: &mut [Hit], marks: &mut [u8]) -> (u64, u64) {
        for (i, hit) in (first..).zip(&mut *hits) {
            let ray = self.ray(i);
            let found = ray.map(|ray| self.scene.closest(&ray));
            *hit = found.filter(Hit::is_hit).unwrap_or(Hit::MISS);
        }
        for (i, (hit, mark)) in (first..).zip(hits.iter().zip(&mut *marks)) {
            *mark = u8::from(self.is_in_shadow(i, hit));
        }
        let found = hits.iter().filter(|hit| hit.is_hit()).count() as u64;
        (found, marks.iter().map(|&mark| u64::from(mark)).sum())
    }

    fn is_in_shadow(&self, ray: usize, hit: &Hit) -> bool {
        let (Some(light), Some(ray)) = (&self.light, self.ray(ray)) else {
            return false;
        };
        if !hit.is_hit() {
            return false;
        }
        let corners = self.moment.corners(hit.triangle);
        let ray = light.ray(hit, &corners, ray.origin);
        self.scene.is_occluded(&ray)
    }

    /// Returns ray `i` without the part behind its origin, which Embree cannot trace, or `None` if it is invalid.
    fn ray(&self, i: usize) -> Option<Ray> {
        let ray = match self.rays {
            Rays::List(rays) => rays[i],
            Rays::Camera(camera) => {
                let width = camera.width as usize;
                camera.ray((i % width) as u32, (i / width) as u32)
            }
            Rays::OnDevice(_) => Ray::VOID,
        };
        let t_min = ray.t_min.max(0.0);
        ray.is_valid().then_some(Ray { t_min, ..ray })
    }
}
