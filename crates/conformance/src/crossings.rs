//! How often rays cross a body.
//!
//! Crossings that lie at the same `t` cannot be told apart by asking again from behind the first. So they are counted
//! over parts of the body in which no two triangles share a vertex, and summed up.

use crate::stage::{ask, open, stand, vertices};
use backend::{Backend, Method, QueryKind, Rays, Result};
use geom::{Animation, Ray};
use std::sync::Arc;

/// Crossings of one part beyond which nobody counts: no body is crossed so often.
const MOST: u32 = 64;

/// How often each ray crosses a body that stands still.
pub(crate) fn crossings(
    subject: &mut dyn Backend,
    method: Method,
    body: &Animation,
    rays: &[Ray],
) -> Result<Vec<u32>> {
    let mut counts = vec![0; rays.len()];
    let points = vertices(body, 0.0);
    for part in parts(body.triangles(), body.vertex_count()) {
        let part = Animation::new(vec![points.clone()], part);
        let part = Arc::new(part.expect("a part names the whole's vertices"));
        open(subject, &part, 0.0, method)?;
        stand(subject, &part, 0.0)?;
        march(subject, rays, &mut counts)?;
    }
    Ok(counts)
}

/// Asks again from behind each hit until there is none.
fn march(subject: &mut dyn Backend, rays: &[Ray], counts: &mut [u32]) -> Result<()> {
    let mut alive: Vec<u32> = (0..rays.len() as u32).collect();
    let mut beyond = rays.to_vec();
    for _ in 0..MOST {
        if alive.is_empty() {
            break;
        }
        let (hits, _) = ask(subject, Rays::List(&beyond), QueryKind::Closest)?;
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

/// The triangles in as few parts as a greedy choice finds, no two of a part sharing a vertex.
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
