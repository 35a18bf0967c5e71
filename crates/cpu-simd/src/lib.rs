//! Backend `cpu`: vector code and wide trees on the host, with the same bits as the reference in `cpu-ref`.
//!
//! The adopted binary tree is collapsed (Wald, Benthin, Boulos 2008). A subtree of at most eight triangles becomes a
//! *block*, whose triangles are tested together. Above the blocks, each node has up to eight children, whose boxes are
//! tested together. Only boxes of nodes and blocks are stored. Boxes of triangles are computed from the corners.
//!
//! Each module uses only modules on its own line and on lines above it:
//!
//! - `simd`, `units`: vectors; `window`, `tiles`: parts of slices and pictures for parallel tasks;
//! - `tree`, `boxes`: nodes, blocks, and operations on eight boxes;
//! - `rays`, `leaf`, `intersect`: prepared rays, and the triangle tests in lanes;
//! - `walk`, `single`, `packet`, `exact`, `search`: traversal, and the searches of rays and packets;
//! - `light`, `visit`, `trace`: shadow rays, the reference's view of the tree, and all rays of a query;
//! - `subtrees`, `fit`, `moving`: preprocess and refit, of all nodes or of the moving ones;
//! - `accelerator`: the tree that the backend adopts.

mod accelerator;
mod boxes;
mod exact;
mod fit;
mod intersect;
mod leaf;
mod light;
mod moving;
mod packet;
mod rays;
mod search;
mod simd;
mod single;
mod subtrees;
#[cfg(test)]
mod tests {
    mod boxes;
    mod simd;
}
mod tiles;
mod trace;
mod tree;
mod units;
mod visit;
mod walk;
mod window;

use accelerator::WideAccelerator;
use backend::{BackendName, Result, TreeFormat};
use cpu_ref::CpuBackend;

pub use simd::InstructionSet;

/// Opens backend `cpu` with a pool of `threads` threads, by default one per core. Uses the best instruction set of the
/// machine.
///
/// # Errors
/// See [`CpuBackend::new`].
pub fn open(threads: Option<usize>) -> Result<CpuBackend> {
    open_at(InstructionSet::best(), threads)
}

/// Opens backend `cpu` like [`open`], with this instruction set.
///
/// # Errors
/// See [`CpuBackend::new`].
pub fn open_at(instruction_set: InstructionSet, threads: Option<usize>) -> Result<CpuBackend> {
    CpuBackend::with_trees(
        BackendName::Cpu,
        TreeFormat::WideBlocks,
        threads,
        move || Box::new(WideAccelerator::new(instruction_set)),
    )
}
