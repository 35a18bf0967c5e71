//! Counts how often rays cross a body.
//!
//! A ray that continues behind a hit skips all other crossings at the same `t`. So the body is split into parts in
//! which no two triangles share a vertex, and the crossings of all parts are added.

use crate::stage::{interpolate_and_refit, open, trace_and_wait, vertices};
use backend::{Backend, Intersector, QueryKind, Rays, Result};
use geom::{Animation, Ray};
use std::sync::Arc;

/// Maximum number of crossings that are counted per part. No ray crosses a body as often as this.
const MOST: u32 = 64;

/// Returns how often each ray crosses a static body.
pub(crate) fn crossings(
    subject: &mut dyn Backend,
    intersector: Intersector,
    body: &Animation,
    rays: &[Ray],
) -> Result<Vec<u32>> {
    let mut counts = vec![0; rays.len()];
    let points = vertices(body, 0.0);
    for part in parts(body.triangles(), body.vertex_count()) {
        let part = Animation::new(vec![points.clone()], part);
        let part = Arc::new(part.expect("a part uses the body's vertices"));
        open(subject, &part, 0.0, intersector)?;
        interpolate_and_refit(subject, &part, 0.0)?;
        march(subject, rays, &mut counts)?;
    }
    Ok(counts)
}

/// Traces the rays again from behind each hit until they miss.
fn march(subject: &mut dyn Backend, rays: &[Ray], counts: &mut [u32]) -> Result<()> {
    let mut alive: Vec<u32> = (0..rays.len() as u32).collect();
    let mut beyond = rays.to_vec();
    for _ in 0..MOST {
        if alive.is_empty() {
            break;
        }
        let hits = trace_and_wait(subject, Rays::List(&beyond), QueryKind::Closest)?.hits;
        let crossed = alive.iter().zip(&beyond).zip(&hits.closest);
        let next = crossed.filter(|(_, hit)| hit.is_hit());
        (alive, beyond) = next
            .map(|((&i, &ray), hit)| {
                counts[i as usize] += 1;
                let t_min = hit.t;
                (i, Ray { t_min, ..ray })
            })
            .unzip();
    }
    Ok(())
}

/// Partitions the triangles greedily into few parts, so that no two triangles of a part share a vertex.
fn parts(triangles: &[[u32; 3]], vertices: usize) -> Vec<Vec<[u32; 3]>> {
    let mut taken: Vec<Vec<bool>> = Vec::new();
    let mut parts: Vec<Vec<[u32; 3]>> = Vec::new();
    for &t in triangles {
        let free = |taken: &Vec<bool>| t.iter().all(|&v| !taken[v as usize]);
        let part = taken.iter().position(free).unwrap_or_else(|| {
            taken.push(vec![false; vertices]);
            parts.push(Vec::new());
            parts.len() - 1
        });
        t.iter().for_each(|&v| taken[part][v as usize] = true);
        parts[part].push(t);
    }
    parts
}
