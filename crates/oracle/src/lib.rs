//! The exact answer, slowly: what a ray hits, decided in integer arithmetic.
//!
//! The judge of every backend, so it shares no code with any: from `geom` it
//! takes plain types only. Its definition is the contract's `exact`. Triangles are
//! closed: a ray through an edge or a vertex hits every triangle that shares
//! it. A ray in a triangle's plane misses it. Inactive triangles and those of
//! zero area are never hit. `t` lies in the open interval `(t_min, t_max)`.
//! Least exact `t` wins, then least index.
//!
//! Each ray passes three rooms, and the first two only ever discard what is
//! surely missed: boxes (`cull`), double precision with proven error bounds
//! (`filter`), and what is left in whole numbers (`exact`).

mod cull;
mod exact;
mod filter;
mod fraction;
mod integers;
#[cfg(test)]
mod naive;
mod near;
mod oracle;

pub use oracle::{ExactHit, Oracle};
