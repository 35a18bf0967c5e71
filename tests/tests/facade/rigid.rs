//! Tests rigid meshes, whose vertices the library transforms.

use crate::pool::tracer;
use crate::{demo, hits_after, scene_of};
use abvh::{Device, Matrix, Mesh, Point, Source};

/// Compares a mesh of two rigid parts with a streamed mesh whose vertices the test transforms by the same operations.
pub(crate) fn rigid_meshes_equal_transformed_vertices(device: &Device) {
    let demo = demo("demo:twist:2000");
    let rest = &demo.keys[0];
    let parts: Vec<u32> = (0..rest.len())
        .map(|v| u32::from(2 * v > rest.len()))
        .collect();
    let rigid = Mesh::rigid(rest, &demo.triangles, &parts).unwrap();
    let streamed = Mesh::streamed(rest, &demo.triangles).unwrap();
    let (rigid, [robot]) = scene_of([rigid]);
    let (streamed, [cloth]) = scene_of([streamed]);
    let [mut rigid, mut streamed] = [rigid, streamed].map(|scene| tracer(scene, device));
    for step in 0..8_u8 {
        let angle = 0.8 * f32::from(step);
        let matrices = [angle, 0.1 + angle].map(turned);
        let vertices = rest.iter().zip(&parts);
        let vertices = vertices.map(|(&v, &part)| transformed(&matrices[part as usize], v));
        let vertices: Vec<Point> = vertices.collect();
        let found = hits_after(&mut rigid, 0.0, &demo.rays, |step| {
            step.poses(robot, &matrices)
        });
        let expected = hits_after(&mut streamed, 0.0, &demo.rays, |step| {
            step.vertices(cloth, Source::Host(&vertices))
        });
        assert!(found == expected, "step {step}");
        let hits = found.iter().filter(|hit| hit[0] != u32::MAX);
        assert!(hits.count() > 100, "step {step}");
    }
}

/// Transforms a vertex as [`Matrix`] documents.
fn transformed(matrix: &Matrix, v: Point) -> Point {
    matrix.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2] + r[3])
}

/// Returns a rotation about the vertical axis, then a small translation.
fn turned(angle: f32) -> Matrix {
    let (sin, cos) = angle.sin_cos();
    [
        [cos, 0.0, sin, 0.01],
        [0.0, 1.0, 0.0, 0.02],
        [-sin, 0.0, cos, 0.03],
    ]
}
