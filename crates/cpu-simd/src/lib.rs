//! The host's answers by vectors: layout `fast`, with the same bits as the reference in `cpu-ref`.
//!
//! Nodes of eight boxes stand over blocks of eight triangles, tested eight at a time. The adopted binary
//! tree is collapsed: a subtree of at most eight triangles becomes a *block*, whose triangles are tested
//! together; above it, nodes take up to eight subtrees each (Wald, Benthin, Boulos 2008). Boxes of single
//! triangles are not kept: whoever needs one has its corners at hand. What a hit is does not change, nor
//! does one bit of it.

mod boxes;
mod exact;
mod fit;
mod intersect;
mod leaf;
mod light;
mod moving;
mod packet;
mod rays;
mod simd;
mod subtrees;
#[cfg(test)]
mod tests {
    mod boxes;
    mod simd;
}
mod trace;
mod tree;
mod visit;
mod walk;

use backend::{Layout, Result};
use cpu_ref::bvh2::Bvh2;
use cpu_ref::{Accelerator, CpuBackend};
use tree::Wide;

pub use simd::Level;

/// The host as a backend, with a pool of `threads` threads, or of one a core: `bvh2` is traced as the reference does,
/// `fast` by the best vectors that the machine has.
///
/// # Errors
/// Those of [`CpuBackend::new`].
pub fn open(threads: Option<usize>) -> Result<CpuBackend> {
    open_at(Level::best(), threads)
}

/// Likewise, by vectors of one instruction set.
///
/// # Errors
/// Those of [`CpuBackend::new`].
pub fn open_at(level: Level, threads: Option<usize>) -> Result<CpuBackend> {
    CpuBackend::with_trees(threads, move |layout| -> Box<dyn Accelerator> {
        match layout {
            Layout::Bvh2 => Box::new(Bvh2::default()),
            Layout::Fast => Box::new(Wide::new(level)),
        }
    })
}
