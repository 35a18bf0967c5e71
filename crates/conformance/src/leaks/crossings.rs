//! How often rays cross a body.

use crate::stage::open_with;
use backend::{Backend, Hits, Method, Query, Rays, Result, Seek};
use geom::{Animation, Ray};
use std::sync::Arc;

/// Crossings of one part beyond which nobody counts: no body is crossed so often.
const MOST: u32 = 64;

/// How often each ray crosses a body that stands still.
///
/// Not for `exact`: asking from behind a rounded `t` finds what lies exactly behind it, perhaps the same triangle.
///
/// # Errors
/// The subject failed.
pub fn crossings(
    subject: &mut dyn Backend,
    method: Method,
    body: &Animation,
    rays: &[Ray],
) -> Result<Vec<u32>> {
    let mut counts = vec![0; rays.len()];
    for part in parts(body.triangles(), body.vertex_count()) {
        let points = body.keys()[0].clone();
        let part = Animation::new(vec![points], part).expect("a part names the whole's vertices");
        march(subject, method, &Arc::new(part), rays, &mut counts)?;
    }
    Ok(counts)
}

/// Asks again from behind each hit until there is none.
fn march(
    subject: &mut dyn Backend,
    method: Method,
    part: &Arc<Animation>,
    rays: &[Ray],
    counts: &mut [u32],
) -> Result<()> {
    open_with(subject, part, 0.0, method)?;
    subject.interpolate(part.pose(0.0))?;
    subject.preprocess()?;
    subject.refit()?;
    let mut alive: Vec<u32> = (0..rays.len() as u32).collect();
    let mut beyond = rays.to_vec();
    let mut hits = Hits::default();
    for _ in 0..MOST {
        if alive.is_empty() {
            break;
        }
        subject.trace(Query {
            rays: Rays::List(&beyond),
            seek: Seek::Closest,
        })?;
        let ticket = subject.submit()?;
        subject.wait(ticket)?;
        subject.hits(ticket, &mut hits)?;
        let crossed = alive.iter().zip(&beyond).zip(&hits.closest);
        let next = crossed.filter(|(_, hit)| hit.is_hit());
        (alive, beyond) = next
            .map(|((&i, &ray), hit)| {
                counts[i as usize] += 1;
                (
                    i,
                    Ray {
                        t_min: hit.t,
                        ..ray
                    },
                )
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_every_triangle_once_and_no_neighbours() {
        let triangles = [[0, 1, 2], [2, 3, 4], [5, 6, 7], [0, 1, 2], [4, 5, 8]];
        let parts = parts(&triangles, 9);
        let mut all = parts.concat();
        all.sort_unstable();
        assert_eq!(all, [[0, 1, 2], [0, 1, 2], [2, 3, 4], [4, 5, 8], [5, 6, 7]]);
        for part in parts {
            let mut vertices = part.concat();
            vertices.sort_unstable();
            assert!(vertices.windows(2).all(|w| w[0] != w[1]));
        }
    }
}
