//! A pool of tracers, so that a device stays open for later tests: its driver compiles kernels only once.

use abvh::{Device, Scene, Tracer, TracerBuilder};
use geom::lock;
use std::ops::{Deref, DerefMut};
use std::sync::Mutex;
use std::thread;

static IDLE: Mutex<Vec<(Device, Tracer)>> = Mutex::new(Vec::new());

/// A tracer that returns to the pool when dropped, unless its test has failed.
pub(crate) struct Pooled {
    device: Device,
    /// `None` once it is dropped.
    tracer: Option<Tracer>,
}

/// Returns a tracer of a scene, with two threads.
pub(crate) fn tracer(scene: Scene, device: &Device) -> Pooled {
    build(Tracer::builder(), scene, device)
}

/// Returns a tracer of a scene, with two threads and the other settings of `builder`.
pub(crate) fn build(builder: TracerBuilder, scene: Scene, device: &Device) -> Pooled {
    let builder = builder.threads(2).device(device.clone());
    let former = {
        let mut idle = lock(&IDLE);
        let found = idle.iter().position(|(d, _)| d == device);
        found.map(|at| idle.swap_remove(at).1)
    };
    let built = match former {
        Some(former) => builder.build_in_place_of(former, scene),
        None => builder.build(scene),
    };
    Pooled {
        device: device.clone(),
        tracer: Some(built.unwrap()),
    }
}

/// Closes all unused tracers.
pub(crate) fn close() {
    lock(&IDLE).clear();
}

impl Deref for Pooled {
    type Target = Tracer;

    fn deref(&self) -> &Tracer {
        self.tracer.as_ref().expect("it is not dropped")
    }
}

impl DerefMut for Pooled {
    fn deref_mut(&mut self) -> &mut Tracer {
        self.tracer.as_mut().expect("it is not dropped")
    }
}

impl Drop for Pooled {
    fn drop(&mut self) {
        let tracer = self.tracer.take().filter(|_| !thread::panicking());
        lock(&IDLE).extend(tracer.map(|tracer| (self.device.clone(), tracer)));
    }
}
