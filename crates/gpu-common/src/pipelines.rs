//! One pipeline per kernel, compiled on first use, or earlier in the background.

use crate::GpuDevice;
use backend::Result;
use geom::{in_parallel, parallelism, start_library_pool};
use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use shaders::{Code, Kernel, Traits};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::{self, JoinHandle};

/// A kernel and its code for a device.
pub type KernelCode = (&'static Kernel, Code);

/// The kernels compiled so far.
pub struct Pipelines<D: GpuDevice> {
    compiled: Vec<(&'static Kernel, Arc<D::Pipeline>)>,
    compiling: Vec<CompilingKernels<D::Pipeline>>,
    /// Kernel variants that the device supports; known once the first kernel has run.
    pub(crate) traits: Traits,
}

/// Kernels that are being compiled in the background.
struct CompilingKernels<P> {
    kernels: Vec<&'static Kernel>,
    /// Taken by the first wait.
    thread: Option<JoinHandle<Result<Vec<P>>>>,
}

impl<P> Drop for CompilingKernels<P> {
    fn drop(&mut self) {
        // Drivers may fail if the process exits while they compile.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl<D: GpuDevice> Pipelines<D> {
    /// Creates the pipelines of these kernels and waits for them.
    ///
    /// # Errors
    /// The device's error if it rejects one.
    pub fn of(gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) -> Result<Self> {
        let mut all = Self {
            compiled: Vec::new(),
            compiling: Vec::new(),
            traits: Traits::default(),
        };
        all.prepare(gpu, kernels)?;
        Ok(all)
    }

    /// Returns the compiled kernels, for another scene on the device.
    pub(crate) fn ready(&self) -> Self {
        Self {
            compiled: self.compiled.clone(),
            compiling: Vec::new(),
            traits: self.traits,
        }
    }

    /// Starts to compile missing kernels and does not wait. Errors are reported when a kernel is needed.
    pub(crate) fn begin(&mut self, gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) {
        let missing = self.missing(kernels);
        if missing.is_empty() {
            return;
        }
        let kernels = missing.iter().map(|(kernel, _)| *kernel).collect();
        let compile = gpu.compiler();
        let make_all = move || {
            let all = || missing.par_iter().map(|&kernel| compile(kernel));
            // Compilation takes seconds. In a pool of its own it does not delay other parallel work.
            match start_library_pool(ThreadPoolBuilder::new().num_threads(parallelism())) {
                Ok(pool) => pool.install(|| all().collect()),
                Err(_) => in_parallel(|| all().collect()),
            }
        };
        // If no thread can be created, the kernels are compiled when they are needed.
        if let Ok(thread) = thread::Builder::new().spawn(make_all) {
            let thread = Some(thread);
            self.compiling.push(CompilingKernels { kernels, thread });
        }
    }

    /// Compiles missing kernels.
    pub(crate) fn prepare(
        &mut self,
        gpu: &D,
        kernels: impl IntoIterator<Item = &'static Kernel>,
    ) -> Result<()> {
        for kernel in kernels {
            if self.find(kernel).is_some() {
                continue;
            }
            let has = |compiling: &CompilingKernels<D::Pipeline>| {
                compiling.kernels.iter().any(|k| k.name == kernel.name)
            };
            if let Some(at) = self.compiling.iter().position(has) {
                self.wait(at)?;
            } else {
                let code = (kernel, kernel.code_for(self.traits));
                let compiled = gpu.compiler()(code)?;
                self.compiled.push((kernel, Arc::new(compiled)));
            }
        }
        Ok(())
    }

    fn wait(&mut self, at: usize) -> Result<()> {
        let mut compiling = self.compiling.swap_remove(at);
        let thread = compiling
            .thread
            .take()
            .expect("a thread is joined only once");
        let compiled = thread
            .join()
            .unwrap_or_else(|e| std::panic::resume_unwind(e))?;
        let compiled = compiled.into_iter().map(Arc::new);
        self.compiled
            .extend(compiling.kernels.iter().copied().zip(compiled));
        Ok(())
    }

    /// Returns the kernels that are neither compiled nor being compiled.
    fn missing(&self, kernels: impl IntoIterator<Item = &'static Kernel>) -> Vec<KernelCode> {
        let mut missing: Vec<KernelCode> = Vec::new();
        for kernel in kernels {
            let being_made = self
                .compiling
                .iter()
                .flat_map(|compiling| &compiling.kernels);
            let mut known = being_made.chain(missing.iter().map(|(k, _)| k));
            if self.find(kernel).is_none() && known.all(|k| k.name != kernel.name) {
                missing.push((kernel, kernel.code_for(self.traits)));
            }
        }
        missing
    }

    fn find(&self, kernel: &Kernel) -> Option<&Arc<D::Pipeline>> {
        let mut compiled = self.compiled.iter();
        let found = compiled.find(|(k, _)| k.name == kernel.name);
        found.map(|(_, pipeline)| pipeline)
    }

    /// Returns a compiled kernel.
    ///
    /// # Panics
    /// If the kernel was not compiled.
    pub(crate) fn get(&self, kernel: &Kernel) -> &Arc<D::Pipeline> {
        let found = self.find(kernel);
        found.expect("pipelines are prepared before they are recorded")
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
