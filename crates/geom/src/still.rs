//! Which parts of an animation never move.

use crate::{Animation, Point};

/// Two classes of motion: what is the same in all key frames, and the rest.
///
/// *The same* means equal bits, not finite ones included. Between key frames a
/// static vertex is equal (`==`) to itself in them, save that `-0` becomes `+0`
/// and an infinite coordinate stays not finite without staying infinite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StaticParts {
    /// For each vertex, whether it has the same bits in all key frames.
    pub vertices: Vec<bool>,
    /// For each triangle, whether all three of its vertices are static. Its box, its area and what rays find of it are, too.
    pub triangles: Vec<bool>,
}

impl StaticParts {
    /// Compares every key frame with the first. All is static where there is one alone.
    #[must_use]
    pub fn of(animation: &Animation) -> Self {
        let bits = |p: &Point| p.map(f32::to_bits);
        let keys = animation.keys();
        let mut vertices = vec![true; animation.vertex_count()];
        for key in &keys[1..] {
            let pairs = keys[0].iter().zip(key);
            for (is_static, (a, b)) in vertices.iter_mut().zip(pairs) {
                *is_static &= bits(a) == bits(b);
            }
        }
        let corners = animation.triangles().iter();
        let triangles = corners
            .map(|t| t.iter().all(|&v| vertices[v as usize]))
            .collect();
        Self {
            vertices,
            triangles,
        }
    }

    /// How many vertices are static.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        count(&self.vertices)
    }

    /// How many triangles are static.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        count(&self.triangles)
    }
}

fn count(of: &[bool]) -> usize {
    of.iter().filter(|&&is_static| is_static).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(keys: Vec<Vec<Point>>, triangles: Vec<[u32; 3]>) -> StaticParts {
        StaticParts::of(&Animation::new(keys, triangles).unwrap())
    }

    #[test]
    fn a_triangle_is_static_if_all_its_vertices_are() {
        let rest = vec![[0.5; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN; 3]];
        for axis in 0..3 {
            for key in 0..3 {
                let mut keys = vec![rest.clone(); 3];
                keys[key][1][axis] += 1e-7;
                let found = parts(keys, vec![[0, 2, 3], [0, 1, 2], [1, 0, 0], [0, 0, 1]]);
                assert_eq!(found.vertices, [true, false, true, true]);
                assert_eq!(found.triangles, [true, false, false, false]);
                assert_eq!((found.vertex_count(), found.triangle_count()), (3, 1));
            }
        }
        assert_eq!(parts(vec![rest], vec![[0, 1, 2]]).triangle_count(), 1);
    }

    #[test]
    fn what_goes_and_comes_back_moves_and_so_does_the_sign_of_zero() {
        let at = |x: f32| vec![[x, 0.0, 0.0], [0.0, x, 0.0]];
        let found = parts(vec![at(0.0), at(1.0), at(0.0)], vec![]);
        assert_eq!(found.vertex_count(), 0);
        assert_eq!(parts(vec![at(0.0), at(-0.0)], vec![]).vertex_count(), 0);
    }

    #[test]
    fn a_static_vertex_is_where_it_was_at_every_pose() {
        let still = [-0.0, 1e-40, 7.3e30];
        let keys: Vec<_> = (0..3).map(|k| vec![still, [k as f32; 3]]).collect();
        let animation = Animation::new(keys, vec![]).unwrap();
        assert_eq!(StaticParts::of(&animation).vertices, [true, false]);
        for time in [0.0, 0.3, 1.0, 1.999] {
            assert_eq!(animation.vertex(animation.pose(time), 0), still);
        }
    }
}
