//! The exact answer, slowly: what a ray hits, decided in integer arithmetic.
//!
//! The reference for every backend, so it shares no code with any: from `geom` it
//! takes plain types only. Its definition is the contract's `exact`. Triangles are
//! closed: a ray through an edge or a vertex hits every triangle that shares
//! it. A ray in a triangle's plane misses it. Inactive triangles and those of
//! zero area are never hit. `t` lies in the open interval `(t_min, t_max)`.
//! Least exact `t` wins, then least index.
//!
//! Each ray passes three stages, and the first two only ever discard what is
//! surely missed: boxes (`cull`), double precision with proven error bounds
//! (`filter`), and what is left in integers (`exact`).

mod cull;
mod exact;
mod filter;
mod search;

pub use search::{ExactHit, Oracle};
