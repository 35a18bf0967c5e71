//! Rays at closed bodies, by every method.

use super::plan::Way;
use crate::choose;
use crate::open::{self, Want};
use crate::stop::Stop;
use crate::threads;
use backend::Intersector;
use chart::{Leaks, Point};
use conformance::leaks::{self, Aim, LeakPlan, OFFSETS};

/// Decides bodies and rays.
const SEED: u64 = 1;
/// The least rays of an offset.
const LEAST: usize = 6_000;

/// What was found, by backend, layout and intersector.
#[derive(Default)]
pub(super) struct LeaksByMethod(Vec<([String; 3], Vec<Leaks>)>);

impl LeaksByMethod {
    /// Whether a point's method was tried.
    pub(super) fn knows(&self, point: &Point) -> bool {
        self.of(point).is_some()
    }

    /// Tries a point's method with a quarter of `rays` at each offset, of which a third are aimed from inside
    /// at edges and vertices.
    pub(super) fn fire(&mut self, way: &Way, point: &Point, rays: usize) -> Result<(), Stop> {
        let method = choose::method(way.method);
        let want = Want {
            backend: way.backend,
            adapter: None,
            threads: threads::cores(),
        };
        let mut backend = open::open(&want, Ok)?.value;
        let plan = LeakPlan {
            seed: SEED,
            rays: ((rays / 4).max(LEAST) * OFFSETS.len()) as u64,
            offsets: OFFSETS.to_vec(),
            method,
        };
        let found = leaks::run(backend.as_mut(), &plan, &mut |_| {})?;
        let mut leaks: Vec<Leaks> = OFFSETS.map(|o| sum(&found.rows, o)).to_vec();
        if method.intersector == Intersector::Exact {
            // Its triangles are closed, so that two may share a hit: no fault, and not counted as one.
            for at in &mut leaks {
                (at.counted, at.double_hits) = (0, 0);
            }
        }
        self.0.push((name(point), leaks));
        Ok(())
    }

    /// Gives every point what was found for its method.
    pub(super) fn hand_out(&self, points: &mut [Point]) {
        for point in points {
            point.leaks = self.of(point).cloned().unwrap_or_default();
        }
    }

    fn of(&self, point: &Point) -> Option<&Vec<Leaks>> {
        let name = name(point);
        self.0.iter().find(|f| f.0 == name).map(|f| &f.1)
    }
}

fn name(point: &Point) -> [String; 3] {
    [&point.backend, &point.layout, &point.intersector].map(Clone::clone)
}

/// All bodies at one offset.
fn sum(rows: &[leaks::LeakRow], offset: f32) -> Leaks {
    let aimed = rows
        .iter()
        .filter(|r| r.offset.to_bits() == offset.to_bits() && r.inside && r.aim != Aim::Random);
    let none = Leaks {
        offset: Some(f64::from(offset)),
        ..Leaks::default()
    };
    aimed.fold(none, |sum, row| Leaks {
        rays: sum.rays + row.rays,
        leaks: sum.leaks + row.leaks,
        counted: sum.counted + row.counted,
        double_hits: sum.double_hits + row.doubled,
        ..sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_rays_aimed_from_inside_at_that_offset_count() {
        let row = leaks::LeakRow {
            body: "box",
            offset: 10.0,
            aim: Aim::Edge,
            inside: true,
            rays: 100,
            leaks: 3,
            counted: 10,
            miscounts: 5,
            doubled: 2,
        };
        let rows = [
            row,
            leaks::LeakRow {
                aim: Aim::Vertex,
                ..row
            },
            leaks::LeakRow {
                aim: Aim::Random,
                ..row
            },
            leaks::LeakRow {
                inside: false,
                ..row
            },
            leaks::LeakRow { offset: 0.0, ..row },
        ];
        let expected = Leaks {
            offset: Some(10.0),
            rays: 200,
            leaks: 6,
            counted: 20,
            double_hits: 4,
        };
        assert_eq!(sum(&rows, 10.0), expected);
    }
}
