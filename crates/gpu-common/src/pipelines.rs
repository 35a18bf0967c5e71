//! One pipeline per kernel, compiled on first use, or earlier in the background.

use crate::GpuDevice;
use backend::Result;
use geom::{in_parallel, lock, parallelism, start_library_pool};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use shaders::{Code, Kernel, Traits};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::{self, JoinHandle};

/// A kernel and its code for a device.
pub type KernelCode = (&'static Kernel, Code);

/// The kernels that are compiled or being compiled.
pub struct Pipelines<D: GpuDevice> {
    /// By name of the kernel.
    slots: HashMap<&'static str, PipelineSlot<D::Pipeline>>,
    /// Threads that compile in the background.
    threads: Vec<JoinHandle<()>>,
    /// Kernel variants that the device supports; known once the first kernel has run.
    pub(crate) traits: Traits,
}

/// A pipeline, or `None` before its kernel is compiled. Locked while the kernel is compiled.
type PipelineSlot<P> = Arc<Mutex<Option<Arc<P>>>>;

/// Compiles a kernel, unless it is compiled already. Waits for a thread that compiles it.
fn fill<P>(
    slot: &PipelineSlot<P>,
    code: KernelCode,
    compile: &impl Fn(KernelCode) -> Result<P>,
) -> Result<()> {
    let mut pipeline = lock(slot);
    if pipeline.is_none() {
        *pipeline = Some(Arc::new(compile(code)?));
    }
    Ok(())
}

impl<D: GpuDevice> Drop for Pipelines<D> {
    fn drop(&mut self) {
        // Drivers may fail if the process exits while they compile.
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

impl<D: GpuDevice> Pipelines<D> {
    /// Creates the pipelines of these kernels and waits for them.
    ///
    /// # Errors
    /// The device's error if it rejects one.
    pub fn of(gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) -> Result<Self> {
        let mut all = Self {
            slots: HashMap::new(),
            threads: Vec::new(),
            traits: Traits::default(),
        };
        all.prepare(gpu, kernels)?;
        Ok(all)
    }

    /// Returns the same kernels, for another scene on the device.
    pub(crate) fn shared(&self) -> Self {
        Self {
            slots: self.slots.clone(),
            threads: Vec::new(),
            traits: self.traits,
        }
    }

    /// Starts to compile missing kernels and does not wait. Errors are reported when a kernel is needed.
    pub(crate) fn begin(&mut self, gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) {
        let mut missing = Vec::new();
        for kernel in kernels {
            if let Entry::Vacant(vacant) = self.slots.entry(kernel.name) {
                let slot = Arc::clone(vacant.insert(PipelineSlot::default()));
                missing.push((slot, (kernel, kernel.code_for(self.traits))));
            }
        }
        if missing.is_empty() {
            return;
        }
        let compile = gpu.compiler();
        let compile_all = move || {
            let all = || {
                missing.par_iter().for_each(|(slot, code)| {
                    // If this fails, the kernel is compiled again when it is needed.
                    let _ = fill(slot, *code, &compile);
                });
            };
            // Compilation takes seconds. In a pool of its own it does not delay other parallel work.
            match start_library_pool(ThreadPoolBuilder::new().num_threads(parallelism())) {
                Ok(pool) => pool.install(all),
                Err(_) => in_parallel(all),
            }
        };
        // If no thread can be created, the kernels are compiled when they are needed.
        self.threads
            .extend(thread::Builder::new().spawn(compile_all));
    }

    /// Compiles missing kernels.
    pub(crate) fn prepare(
        &mut self,
        gpu: &D,
        kernels: impl IntoIterator<Item = &'static Kernel>,
    ) -> Result<()> {
        let compile = gpu.compiler();
        for kernel in kernels {
            let slot = self.slots.entry(kernel.name).or_default();
            fill(slot, (kernel, kernel.code_for(self.traits)), &compile)?;
        }
        Ok(())
    }

    /// Returns a compiled kernel.
    ///
    /// # Panics
    /// If the kernel was not compiled.
    pub(crate) fn get(&self, kernel: &Kernel) -> Arc<D::Pipeline> {
        let slot = self.slots.get(kernel.name);
        let pipeline = slot.and_then(|slot| lock(slot).clone());
        pipeline.expect("pipelines are prepared before they are recorded")
    }
}

/// Lock between compilation of kernels and creation or destruction of devices. NVIDIA's driver 580 deadlocks if they
/// run at the same time.
static COMPILATION_LOCK: RwLock<()> = RwLock::new(());

/// Locks out creation and destruction of devices while kernels are compiled. Several threads may hold this lock.
pub fn lock_compilation() -> RwLockReadGuard<'static, ()> {
    COMPILATION_LOCK
        .read()
        .unwrap_or_else(PoisonError::into_inner)
}

/// Locks out compilation of kernels while a device is created or destroyed.
pub fn lock_device_lifetime() -> RwLockWriteGuard<'static, ()> {
    COMPILATION_LOCK
        .write()
        .unwrap_or_else(PoisonError::into_inner)
}
