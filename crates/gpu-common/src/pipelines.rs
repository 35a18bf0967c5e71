//! One pipeline a kernel, made when a method, a tree to be made or a trace first needs it.

use crate::GpuDevice;
use backend::{Method, Result};
use shaders::work::Work;
use shaders::{KERNELS, Kernel, Traits};

/// Kernels ready to be bound: those that all methods share, and those of every method loaded so far.
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
        kernels.into_iter().try_for_each(|k| all.make(gpu, k))?;
        Ok(all)
    }

    /// Those that all methods share.
    pub(crate) fn shared(gpu: &D) -> Result<Self> {
        let shared = KERNELS.iter().filter(|k| k.slots.is_empty());
        let none = Traits::default();
        Self::of(gpu, shared.filter(|k| is_usual(k) && k.suits(none)))
    }

    /// Makes what `method` needs and is not there yet.
    pub(crate) fn prepare(&mut self, gpu: &D, method: Method) -> Result<()> {
        self.make_all(gpu, |k| k.serves(method) && is_usual(k))
    }

    /// Makes what makes trees for `method`, if it is not there yet.
    pub(crate) fn prepare_trees(&mut self, gpu: &D, method: Method) -> Result<()> {
        self.make_all(gpu, |k| k.makes_trees() && k.serves(method))
    }

    /// Makes what this work needs and is not there yet.
    pub(crate) fn prepare_work<'a>(
        &mut self,
        gpu: &D,
        work: impl IntoIterator<Item = &'a Work>,
    ) -> Result<()> {
        work.into_iter().try_for_each(|w| self.make(gpu, w.kernel))
    }

    fn make_all(&mut self, gpu: &D, wanted: impl Fn(&Kernel) -> bool) -> Result<()> {
        let traits = self.traits;
        let mut wanted = KERNELS.iter().filter(|k| wanted(k) && k.suits(traits));
        wanted.try_for_each(|k| self.make(gpu, k))
    }

    fn make(&mut self, gpu: &D, kernel: &'static Kernel) -> Result<()> {
        if self.find(kernel).is_none() {
            let pipeline = gpu.pipeline(kernel, kernel.code_for(self.traits))?;
            self.made.push((kernel, pipeline));
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

/// Whether a kernel is made with the method that it serves.
fn is_usual(kernel: &Kernel) -> bool {
    !kernel.makes_trees() && !kernel.rasterizes() && !kernel.answers_extremes()
}
