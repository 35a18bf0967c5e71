//! Key-framed triangles: the part of a scene that decides what rays hit.

use crate::range::{Range, Ranges};
use crate::{Aabb, Point, Pose, StaticParts, Triangle, is_active};
use std::sync::OnceLock;

/// N >= 1 key frames over one list of triangles.
#[derive(Clone, Debug)]
pub struct Animation {
    keys: Vec<Vec<Point>>,
    triangles: Vec<[u32; 3]>,
    /// Triangles that are inactive in some key frames, and where they stand when first active.
    fallback_corners: Vec<(u32, Aabb)>,
    never_active: u32,
    /// Found when first asked for.
    static_parts: OnceLock<StaticParts>,
    /// Likewise.
    ranges: OnceLock<Ranges>,
    times: Option<Times>,
}

/// Where key frames stand in time, if not at 0, 1, 2 and so on.
#[derive(Clone, Debug)]
struct Times {
    keys: Vec<f64>,
    end: f64,
}

/// Why key frames and triangles do not make an animation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct AnimationError(String);

impl Animation {
    /// The most triangles one animation may have: a tree of them has fewer than 2^31 nodes.
    pub const MAX_TRIANGLES: usize = 1 << 30;

    /// Checks that the parts fit together and finds triangles that come and go.
    ///
    /// # Errors
    /// There is no key frame, they differ in their numbers of vertices, or a triangle names a vertex that does not exist; or
    /// there are more triangles than [`Self::MAX_TRIANGLES`].
    pub fn new(keys: Vec<Vec<Point>>, triangles: Vec<[u32; 3]>) -> Result<Self, AnimationError> {
        let bad = |cause: String| Err(AnimationError(cause));
        let Some(vertices) = keys.first().map(Vec::len) else {
            return bad("an animation needs at least one key frame".to_owned());
        };
        if let Some(key) = keys.iter().position(|frame| frame.len() != vertices) {
            let found = keys[key].len();
            return bad(format!(
                "key frame {key} has {found} vertices, the first has {vertices}"
            ));
        }
        let (count, limit) = (triangles.len(), Self::MAX_TRIANGLES);
        if count > limit {
            return bad(format!(
                "{count} triangles are more than the limit of {limit}"
            ));
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return bad(format!(
                    "triangle {triangle} names vertex {vertex}, but there are {vertices}"
                ));
            }
        }
        let (fallback_corners, never_active) = find_fallback_corners(&keys, &triangles);
        Ok(Self {
            keys,
            triangles,
            fallback_corners,
            never_active,
            static_parts: OnceLock::new(),
            ranges: OnceLock::new(),
            times: None,
        })
    }

    /// Plays key frames at times of their own, from 0 to `end`: as what is left of an animation with more of them, in whose
    /// key frames time is still measured. Before the first and after the last of them nothing moves.
    ///
    /// # Errors
    /// There is not one time a key frame, or they do not rise from 0 to `end`.
    pub fn timed(self, keys: Vec<f64>, end: f64) -> Result<Self, AnimationError> {
        let rising = keys.is_sorted_by(|a, b| a < b);
        let within = keys.iter().all(|t| (0.0..=end).contains(t));
        if keys.len() != self.keys.len() || !rising || !within || !end.is_finite() {
            let cause =
                "key frames need one time each, rising from 0 on and none of them after the end";
            return Err(AnimationError(cause.to_owned()));
        }
        let times = Some(Times { keys, end });
        Ok(Self { times, ..self })
    }

    /// The times of key frames, if they are not 0, 1, 2 and so on.
    pub fn times(&self) -> Option<&[f64]> {
        self.times.as_ref().map(|t| &t.keys[..])
    }

    /// Whole times from 0 to the end: as many as there are key frames, unless these have times of their own.
    pub fn whole_times(&self) -> usize {
        self.end() as usize + 1
    }

    /// The key frames, each with one position a vertex.
    pub fn keys(&self) -> &[Vec<Point>] {
        &self.keys
    }

    /// Three vertices a triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Vertices in each key frame.
    pub fn vertex_count(&self) -> usize {
        self.keys[0].len()
    }

    /// Triangles, inactive ones included.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Triangles that are active in at least one key frame. A tree holds exactly these.
    pub fn live_count(&self) -> usize {
        self.triangles.len() - self.never_active as usize
    }

    /// What never moves. Looks at every key frame when first called.
    pub fn static_parts(&self) -> &StaticParts {
        self.static_parts.get_or_init(|| StaticParts::of(self))
    }

    /// Live triangles that move: those whose leaves every frame must preprocess.
    pub fn moving_count(&self) -> usize {
        match self.keys.as_slice() {
            [_] => 0,
            // A static triangle is finite in all key frames, and so live.
            _ => self.live_count() - self.static_parts().triangle_count(),
        }
    }

    /// The last time there is, in key frames.
    pub fn end(&self) -> f64 {
        let equal = (self.keys.len() - 1) as f64;
        self.times.as_ref().map_or(equal, |t| t.end)
    }

    /// The pose at `time`; see [`Pose::at`] and [`Pose::among`].
    pub fn pose(&self, time: f64) -> Pose {
        match &self.times {
            Some(times) => Pose::among(time, &times.keys),
            None => Pose::at(time, self.keys.len()),
        }
    }

    /// One vertex at `pose`: the same bits as every backend's.
    #[inline]
    pub fn vertex(&self, pose: Pose, vertex: u32) -> Point {
        let a = self.keys[pose.key as usize][vertex as usize];
        if pose.alpha == 0.0 {
            return a;
        }
        pose.blend(a, self.keys[pose.key as usize + 1][vertex as usize])
    }

    /// One triangle's corners at `pose`.
    #[inline]
    pub fn corners(&self, pose: Pose, triangle: u32) -> Triangle {
        self.triangles[triangle as usize].map(|v| self.vertex(pose, v))
    }

    /// The box that stands for `triangle` in a tree while it is inactive:
    /// where it is in the first key frame that has it active.
    /// [`Aabb::EMPTY`] if no key frame has it active.
    ///
    /// Inactive triangles are left out of what rays see, not out of the tree:
    /// whoever comes back must already have a leaf.
    pub fn fallback_corner(&self, triangle: u32) -> Aabb {
        if let Ok(i) = (self.fallback_corners).binary_search_by_key(&triangle, |s| s.0) {
            return self.fallback_corners[i].1;
        }
        let corners = corners_in(&self.keys[0], self.triangles[triangle as usize]);
        active_box(&corners).unwrap_or(Aabb::EMPTY)
    }

    /// Whether a tree must hold `triangle`: some key frame has it active.
    pub fn is_live(&self, triangle: u32) -> bool {
        self.never_active == 0 || !self.fallback_corner(triangle).is_empty()
    }

    /// The box a tree is built over for `triangle`, given all vertices at the
    /// moment of building: its own, its stand-in while it is inactive, or
    /// [`Aabb::EMPTY`] if it is never active.
    #[inline]
    pub fn build_box(&self, positions: &[Point], triangle: u32) -> Aabb {
        let corners = corners_in(positions, self.triangles[triangle as usize]);
        active_box(&corners).unwrap_or_else(|| self.fallback_corner(triangle))
    }

    /// [`Self::build_box`] at `pose`.
    #[inline]
    pub fn build_box_at(&self, pose: Pose, triangle: u32) -> Aabb {
        active_box(&self.corners(pose, triangle)).unwrap_or_else(|| self.fallback_corner(triangle))
    }

    /// `k`, such that `2^-k` brings the scene to a size whose products neither
    /// overflow nor underflow: 0 unless the largest finite `|coordinate|` of all
    /// key frames lies outside `[2^-10, 2^30]`, else its exponent, within `-126..=126`;
    /// 0 also if some key frame is [extreme](Range::extreme) by itself.
    pub fn scale_exponent(&self) -> i32 {
        self.ranges().scale_exponent
    }

    /// How far coordinates reach at `pose`. Looks at every key frame when first called.
    pub fn range(&self, pose: Pose) -> Range {
        self.ranges().at(pose)
    }

    fn ranges(&self) -> &Ranges {
        self.ranges.get_or_init(|| Ranges::of(self))
    }

    /// The least box that holds every finite vertex of every key frame.
    pub fn bounds(&self) -> Aabb {
        self.keys
            .iter()
            .flatten()
            .filter(|p| p.iter().all(|x| x.is_finite()))
            .fold(Aabb::EMPTY, |b, &p| b.with_point(p))
    }
}

#[inline]
fn corners_in(frame: &[Point], triangle: [u32; 3]) -> Triangle {
    triangle.map(|v| frame[v as usize])
}

#[inline]
fn active_box(corners: &Triangle) -> Option<Aabb> {
    is_active(corners).then(|| Aabb::of_triangle(corners))
}

/// Corners to build with, by triangle, for those inactive in some key frame but not in all; and how many are inactive in all.
fn find_fallback_corners(keys: &[Vec<Point>], triangles: &[[u32; 3]]) -> (Vec<(u32, Aabb)>, u32) {
    let finite = |p: &Point| p.iter().all(|x| x.is_finite());
    let broken: Vec<bool> = (0..keys[0].len())
        .map(|v| keys.iter().any(|frame| !finite(&frame[v])))
        .collect();
    let mut fallback_corners = Vec::new();
    let mut never_active = 0;
    for (i, &t) in triangles.iter().enumerate() {
        if !t.iter().any(|&v| broken[v as usize]) {
            continue;
        }
        let mut moments = keys.iter().map(|frame| corners_in(frame, t));
        match moments.find(is_active) {
            Some(corners) => fallback_corners.push((i as u32, Aabb::of_triangle(&corners))),
            None => never_active += 1,
        }
    }
    (fallback_corners, never_active)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [Point; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    #[test]
    fn a_triangle_that_comes_and_goes_keeps_a_stand_in() {
        let mut broken = SQUARE;
        broken[3] = [f32::NAN; 3];
        let keys = vec![broken.to_vec(), SQUARE.to_vec()];
        let a = Animation::new(keys, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert_eq!(a.live_count(), 2);
        assert!(a.is_live(1) && !a.build_box(&a.keys()[0], 1).is_empty());
        let always = Animation::new(vec![broken.to_vec()], vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert_eq!(always.live_count(), 1);
        assert!(always.is_live(0) && !always.is_live(1));
        assert!(always.build_box(&broken, 1).is_empty());
    }

    #[test]
    fn a_triangle_whose_blend_overflows_is_built_over_where_it_is_first_active() {
        let far = |x: f32| vec![[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        let a = Animation::new(vec![far(3e38), far(-3e38)], vec![[0, 1, 2]]).unwrap();
        let pose = a.pose(0.5);
        let positions: Vec<Point> = (0..3).map(|v| a.vertex(pose, v)).collect();
        assert!(a.is_live(0) && !is_active(&a.corners(pose, 0)));
        let first = Aabb::of_triangle(&a.corners(a.pose(0.0), 0));
        assert_eq!(a.build_box(&positions, 0), first);
        assert_eq!(a.build_box_at(pose, 0), first);
        assert_eq!(a.build_box_at(a.pose(1.0), 0).min[0], -3e38);
    }

    #[test]
    fn parts_that_do_not_fit_are_refused() {
        let square = || SQUARE.to_vec();
        for (keys, triangles, says) in [
            (vec![], vec![], "an animation needs at least one key frame"),
            (
                vec![square(), SQUARE[..3].to_vec()],
                vec![],
                "key frame 1 has 3 vertices, the first has 4",
            ),
            (
                vec![square()],
                vec![[0, 1, 4]],
                "triangle 0 names vertex 4, but there are 4",
            ),
        ] {
            let e = Animation::new(keys, triangles).unwrap_err();
            assert_eq!(e.to_string(), says);
        }
    }
}
