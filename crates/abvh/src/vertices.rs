//! Sets and copies vertices with several threads.

use crate::Point;
use geom::{in_parallel, in_parallel_scope, lock};
use rayon::prelude::*;
use std::sync::Mutex;

/// Number of vertices up to which the calling thread works alone, because a busy pool would start later than it
/// finishes.
const FEW: usize = 1 << 16;

/// Sets each vertex to the value that `of` returns for its index. Uses all threads if there are many vertices.
pub(crate) fn set(to: &mut [Point], of: impl Fn(usize) -> Point + Sync) {
    let one = |(v, to): (usize, &mut Point)| *to = of(v);
    if to.len() <= FEW {
        to.iter_mut().enumerate().for_each(one)
    } else {
        in_parallel(|| {
            let all = to.par_iter_mut().enumerate();
            all.with_min_len(FEW / 4).for_each(one);
        })
    }
}

/// Number of threads that help to copy. They may start late during a tree build, and then find no work left.
const HELPERS: usize = 3;
/// Number of vertices that a thread copies at a time.
const RUN: usize = 1 << 13;

/// Copies vertices or hits between slices of equal length. Uses several threads if there are many.
pub(crate) fn copy<T: Copy + Send + Sync>(to: &mut [T], from: &[T]) {
    if to.len() <= FEW {
        return to.copy_from_slice(from);
    }
    let runs = Mutex::new(to.chunks_mut(RUN).zip(from.chunks(RUN)));
    let next = || lock(&runs).next();
    let copy_runs = || {
        while let Some((to, from)) = next() {
            to.copy_from_slice(from);
        }
    };
    in_parallel_scope(|scope| {
        (0..HELPERS).for_each(|_| scope.spawn(|_| copy_runs()));
        copy_runs();
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_vertices_are_copied_as_few_are() {
        let from: Vec<Point> = (0..FEW + RUN + 3).map(|v| [v as f32; 3]).collect();
        for from in [&from[..3], &from[..FEW], &from] {
            let mut to = vec![[0.0; 3]; from.len()];
            copy(&mut to, from);
            assert!(to == from);
        }
    }
}
