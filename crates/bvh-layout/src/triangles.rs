//! The check that leaves name triangles of the scene, each at most once.

use crate::RecordError;

/// Checks the triangle of each leaf against a scene of `triangles` triangles.
pub(crate) fn check(leaf_triangles: &[u32], triangles: u32) -> Result<(), RecordError> {
    let mut seen = vec![0_u64; (triangles as usize).div_ceil(64)];
    for (leaf, &triangle) in leaf_triangles.iter().enumerate() {
        if triangle >= triangles {
            return Err(RecordError::TriangleRange {
                leaf,
                triangle,
                triangles,
            });
        }
        let (word, bit) = (triangle as usize / 64, 1 << (triangle % 64));
        if seen[word] & bit != 0 {
            let first = leaf_triangles.iter().position(|&t| t == triangle);
            return Err(RecordError::TriangleTwice {
                triangle,
                first: first.unwrap_or(leaf),
                second: leaf,
            });
        }
        seen[word] |= bit;
    }
    Ok(())
}
