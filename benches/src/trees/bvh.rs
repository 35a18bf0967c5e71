//! `bvh`: binned builds in parallel; no refit.

use super::{CrateTree, Node};
use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::{Bvh as Tree, BvhNode};
use geom::Ray;
use nalgebra::Vector3;

/// Tree of the crate `bvh`.
#[derive(Default)]
pub(super) struct Bvh {
    soup: Vec<Shape>,
    tree: Option<Tree<f32, 3>>,
}

/// A triangle in the crate's format.
struct Shape {
    corners: geom::Triangle,
    triangle: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        let bounds = geom::Aabb::of_triangle(&self.corners);
        Aabb::with_bounds(bounds.min.into(), bounds.max.into())
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Bvh {
    fn tree(&self) -> &Tree<f32, 3> {
        self.tree.as_ref().expect("a tree is built first")
    }

    /// Returns the closest hit, or any hit if `first` is set.
    ///
    /// Visits triangles in the order in which the ray enters their boxes. Tests triangles here, because the crate's own
    /// test culls back faces.
    fn search(&self, ray: &Ray, first: bool) -> Option<(f32, u32)> {
        let direction = Vector3::from(ray.direction);
        let length = direction.norm();
        let here = bvh::ray::Ray::new(ray.origin.into(), direction);
        let (mut t_best, mut best) = (ray.t_max, None);
        for shape in self.tree().nearest_traverse_iterator(&here, &self.soup) {
            let entry = here.intersection_slice_for_aabb(&shape.aabb());
            // The crate normalizes directions, so its distances are `length` times ours.
            if entry.is_some_and(|(near, _)| near > t_best * length) {
                break;
            }
            if let Some(t) = moller_trumbore(ray, &shape.corners).filter(|&t| t < t_best) {
                (t_best, best) = (t, Some((t, shape.triangle)));
                if first {
                    break;
                }
            }
        }
        best
    }
}

impl CrateTree for Bvh {
    fn name(&self) -> &'static str {
        "bvh"
    }

    fn can_refit(&self) -> bool {
        false
    }

    fn set_triangles(&mut self, triangles: &[geom::Triangle]) {
        let shape = |(&corners, triangle): (&geom::Triangle, u32)| Shape {
            corners,
            triangle,
            node: 0,
        };
        self.soup = triangles.iter().zip(0..).map(shape).collect();
    }

    fn build(&mut self) {
        self.tree = Some(Tree::build_par(&mut self.soup));
    }

    fn closest(&self, ray: &Ray) -> Option<(f32, u32)> {
        self.search(ray, false)
    }

    fn blocked(&self, ray: &Ray) -> bool {
        self.search(ray, true).is_some()
    }

    fn nodes(&self) -> Vec<Node> {
        let node = |node: &BvhNode<f32, 3>| {
            let bounds = node.get_node_aabb(&self.soup);
            let [min, max] = [bounds.min, bounds.max].map(Into::into);
            (geom::Aabb { min, max }, u32::from(node.is_leaf()))
        };
        self.tree().nodes.iter().map(node).collect()
    }
}

/// Two-sided test (Möller, Trumbore 1997) without an absolute threshold, over `(0, inf)`.
fn moller_trumbore(ray: &Ray, corners: &geom::Triangle) -> Option<f32> {
    let [a, b, c] = corners.map(Vector3::from);
    let direction = Vector3::from(ray.direction);
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(&ac);
    let inverse = 1.0 / ab.dot(&p);
    let from_a = Vector3::from(ray.origin) - a;
    let u = from_a.dot(&p) * inverse;
    let q = from_a.cross(&ab);
    let v = direction.dot(&q) * inverse;
    let t = ac.dot(&q) * inverse;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}
