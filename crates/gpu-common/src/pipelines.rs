//! One pipeline a kernel, made when something first needs it, on threads of their own where that is known before.

use crate::GpuDevice;
use backend::Result;
use geom::{in_parallel, own_pool, parallelism};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use shaders::{Code, Kernel, Traits};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::{self, JoinHandle};

/// A kernel, and its code for the device at hand.
pub type KernelCode = (&'static Kernel, Code);

/// Kernels ready to be bound: those that anything needed so far.
pub struct Pipelines<D: GpuDevice> {
    made: Vec<(&'static Kernel, Arc<D::Pipeline>)>,
    making: Vec<Making<D::Pipeline>>,
    /// Which forms of kernels the device takes; known once the first of them has run.
    pub(crate) traits: Traits,
}

/// Kernels that threads of their own make ready.
struct Making<P> {
    kernels: Vec<&'static Kernel>,
    /// Taken when it is waited for.
    thread: Option<JoinHandle<Result<Vec<P>>>>,
}

impl<P> Drop for Making<P> {
    fn drop(&mut self) {
        // Drivers do not like a process to end while they compile.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl<D: GpuDevice> Pipelines<D> {
    /// These, and no others until more are asked for.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] if the driver refuses one.
    pub fn of(gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) -> Result<Self> {
        let mut all = Self {
            made: Vec::new(),
            making: Vec::new(),
            traits: Traits::default(),
        };
        all.prepare(gpu, kernels)?;
        Ok(all)
    }

    /// Those that are ready, for another scene on the device.
    pub(crate) fn ready(&self) -> Self {
        Self {
            made: self.made.clone(),
            making: Vec::new(),
            traits: self.traits,
        }
    }

    /// Begins to make what is not there yet, and does not wait for it. What goes wrong is found when it is needed.
    pub(crate) fn begin(&mut self, gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) {
        let missing = self.missing(kernels);
        if missing.is_empty() {
            return;
        }
        let kernels = missing.iter().map(|(kernel, _)| *kernel).collect();
        let make = gpu.pipeline_maker();
        let make_all = move || {
            let all = || {
                missing
                    .par_iter()
                    .map(|&kernel| D::make_pipeline(&make, kernel))
            };
            // Compilers work for seconds, which other parallel work must not wait for.
            match own_pool(ThreadPoolBuilder::new().num_threads(parallelism())) {
                Ok(pool) => pool.install(|| all().collect()),
                Err(_) => in_parallel(|| all().collect()),
            }
        };
        // Without a thread to be had, they are made when they are needed.
        if let Ok(thread) = thread::Builder::new().spawn(make_all) {
            let thread = Some(thread);
            self.making.push(Making { kernels, thread });
        }
    }

    /// Makes what is not there yet.
    pub(crate) fn prepare(
        &mut self,
        gpu: &D,
        kernels: impl IntoIterator<Item = &'static Kernel>,
    ) -> Result<()> {
        for kernel in kernels {
            if self.find(kernel).is_some() {
                continue;
            }
            let has =
                |making: &Making<D::Pipeline>| making.kernels.iter().any(|k| k.name == kernel.name);
            if let Some(at) = self.making.iter().position(has) {
                self.wait(at)?;
            } else {
                let code = (kernel, kernel.code_for(self.traits));
                let made = D::make_pipeline(&gpu.pipeline_maker(), code)?;
                self.made.push((kernel, Arc::new(made)));
            }
        }
        Ok(())
    }

    fn wait(&mut self, at: usize) -> Result<()> {
        let mut making = self.making.swap_remove(at);
        let thread = making.thread.take().expect("nobody waited for it");
        let made = thread
            .join()
            .unwrap_or_else(|e| std::panic::resume_unwind(e))?;
        let made = made.into_iter().map(Arc::new);
        self.made.extend(making.kernels.iter().copied().zip(made));
        Ok(())
    }

    /// Those that are neither there nor being made.
    fn missing(&self, kernels: impl IntoIterator<Item = &'static Kernel>) -> Vec<KernelCode> {
        let mut missing: Vec<KernelCode> = Vec::new();
        for kernel in kernels {
            let being_made = self.making.iter().flat_map(|making| &making.kernels);
            let mut known = being_made.chain(missing.iter().map(|(k, _)| k));
            if self.find(kernel).is_none() && known.all(|k| k.name != kernel.name) {
                missing.push((kernel, kernel.code_for(self.traits)));
            }
        }
        missing
    }

    fn find(&self, kernel: &Kernel) -> Option<&D::Pipeline> {
        let mut made = self.made.iter();
        let found = made.find(|(k, _)| k.name == kernel.name);
        found.map(|(_, pipeline)| &**pipeline)
    }

    /// # Panics
    /// If it was not made.
    pub(crate) fn get(&self, kernel: &Kernel) -> &D::Pipeline {
        let found = self.find(kernel);
        found.expect("pipelines are prepared before they are recorded")
    }
}

/// One driver (NVIDIA 580) locks itself up when a thread makes or destroys a device while another compiles kernels.
static DOOR: RwLock<()> = RwLock::new(());

/// Held while kernels are compiled, which several threads may do at a time.
pub fn compile_door() -> RwLockReadGuard<'static, ()> {
    DOOR.read().unwrap_or_else(PoisonError::into_inner)
}

/// Held while a device is made or destroyed.
pub fn device_door() -> RwLockWriteGuard<'static, ()> {
    DOOR.write().unwrap_or_else(PoisonError::into_inner)
}
