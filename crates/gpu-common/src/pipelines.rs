//! One pipeline a kernel, made when a method, a tree to be made or a trace first needs it.

use crate::GpuDevice;
use backend::{Method, Result};
use shaders::work::Work;
use shaders::{Code, KERNELS, Kernel, Traits};

/// Kernels ready to be bound: those that anything needed so far.
pub struct Pipelines<D: GpuDevice> {
    made: Vec<(&'static Kernel, D::Pipeline)>,
    /// Which forms of kernels the device takes; known once the first of them has run.
    pub(crate) traits: Traits,
}

impl<D: GpuDevice> Pipelines<D> {
    /// These, and no others until more are asked for.
    ///
    /// # Errors
    /// [`backend::BackendError::NoDevice`] if the driver refuses one.
    pub fn of(gpu: &D, kernels: impl IntoIterator<Item = &'static Kernel>) -> Result<Self> {
        let mut all = Self {
            made: Vec::new(),
            traits: Traits::default(),
        };
        all.make(gpu, kernels)?;
        Ok(all)
    }

    /// Makes what every frame by `method` needs before its trace.
    pub(crate) fn prepare(&mut self, gpu: &D, method: Method) -> Result<()> {
        let traits = self.traits;
        let wanted = |k: &&Kernel| k.serves(method) && k.suits(traits) && k.precedes_traces();
        self.make(gpu, KERNELS.iter().filter(wanted))
    }

    /// Makes what makes trees for `method`, if it is not there yet.
    pub(crate) fn prepare_trees(&mut self, gpu: &D, method: Method) -> Result<()> {
        let wanted = |k: &&Kernel| k.makes_trees() && k.serves(method);
        self.make(gpu, KERNELS.iter().filter(wanted))
    }

    /// Makes what this work needs and is not there yet.
    pub(crate) fn prepare_work<'a>(
        &mut self,
        gpu: &D,
        work: impl IntoIterator<Item = &'a Work>,
    ) -> Result<()> {
        self.make(gpu, work.into_iter().map(|w| w.kernel))
    }

    fn make(
        &mut self,
        gpu: &D,
        kernels: impl IntoIterator<Item = &'static Kernel>,
    ) -> Result<()> {
        let mut missing: Vec<(&Kernel, Code)> = Vec::new();
        for kernel in kernels {
            let is_listed = missing.iter().any(|(k, _)| k.name == kernel.name);
            if self.find(kernel).is_none() && !is_listed {
                missing.push((kernel, kernel.code_for(self.traits)));
            }
        }
        if !missing.is_empty() {
            let made = gpu.pipelines(&missing)?;
            let kernels = missing.iter().map(|(kernel, _)| *kernel);
            self.made.extend(kernels.zip(made));
        }
        Ok(())
    }

    fn find(&self, kernel: &Kernel) -> Option<&D::Pipeline> {
        let mut made = self.made.iter();
        let found = made.find(|(k, _)| k.name == kernel.name);
        found.map(|(_, pipeline)| pipeline)
    }

    /// # Panics
    /// If it was not made.
    pub(crate) fn get(&self, kernel: &Kernel) -> &D::Pipeline {
        let found = self.find(kernel);
        found.expect("pipelines are made when a method is loaded")
    }
}
