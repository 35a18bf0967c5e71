//! Triangles with key frames: the geometry of a scene.

use crate::key_frame::{check_key, read_key};
use crate::key_frames::KeyFrames;
use crate::key_window::KeyWindow;
use crate::sizes::Sizes;
use crate::streamed_keys::StreamedKeys;
use crate::survey::{Survey, check_triangles};
use crate::triangle::corners;
use crate::{
    Aabb, CoordinateRange, KeyFrame, KeyFrameError, KeySource, Point, PointBuffer, Pose,
    StaticParts, Triangle, is_active,
};
use std::sync::Arc;

/// One or more key frames over one list of triangles.
#[derive(Clone, Debug)]
pub struct Animation {
    keys: KeyFrames,
    triangles: Vec<[u32; 3]>,
    survey: Survey,
}

impl Animation {
    /// Maximum number of triangles. A tree over this many has fewer than 2^31 nodes.
    pub const MAX_TRIANGLES: usize = 1 << 30;

    /// Creates an animation that holds all its key frames in memory.
    ///
    /// Checks that the parts are consistent, and surveys all key frames: bounds, ranges, static parts, and triangles
    /// that are inactive in the first or in all.
    ///
    /// # Errors
    /// There is no key frame, or key frames have different numbers of vertices. A triangle names a vertex that does not
    /// exist, or there are more triangles than [`Self::MAX_TRIANGLES`].
    pub fn new(keys: Vec<Vec<Point>>, triangles: Vec<[u32; 3]>) -> Result<Self, KeyFrameError> {
        let keys: Vec<KeyFrame> = keys.into_iter().map(|k| Arc::new(k.into())).collect();
        check_keys(keys.len())?;
        let first = &keys[0];
        let mut numbered = keys.iter().enumerate();
        numbered.try_for_each(|(key, frame)| check_key(key, frame.len(), first.len()))?;
        Self::over(KeyFrames::Held(keys), triangles)
    }

    /// Creates an animation of `keys` key frames that reads them during playback.
    ///
    /// Keeps up to `window` key frames in memory, or four if `window` is less. The first key frame is always kept and
    /// does not count. Reads every key frame once to determine bounds, ranges and static parts.
    ///
    /// # Errors
    /// Those of [`Self::new`]. A key frame cannot be read, or the threads that read key frames cannot be started.
    pub fn paged(
        source: Arc<KeySource>,
        keys: usize,
        window: usize,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, KeyFrameError> {
        check_keys(keys)?;
        let first = Arc::new(read_key(&*source, 0)?.into());
        let window = KeyWindow::new(source, first, keys, window)?;
        Self::over(KeyFrames::Paged(Arc::new(window)), triangles)
    }

    /// Creates an animation whose key frames [arrive](Self::push) during playback, after `first`.
    ///
    /// Vertices marked `fixed` have the same bits in all key frames. The others may move anywhere.
    ///
    /// # Errors
    /// Those of [`Self::new`], or `fixed` does not have one mark per vertex.
    pub fn streamed(
        first: Vec<Point>,
        fixed: &[bool],
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, KeyFrameError> {
        check_fixed(fixed.len(), first.len())?;
        let keys = StreamedKeys::new(Arc::new(first.into()));
        let mut streamed = Self::over(KeyFrames::Streamed(Arc::new(keys)), triangles)?;
        let (first, triangles) = (streamed.keys.first(), &streamed.triangles);
        streamed.survey.adapt_to_streaming(first, triangles, fixed);
        Ok(streamed)
    }

    fn over(keys: KeyFrames, triangles: Vec<[u32; 3]>) -> Result<Self, KeyFrameError> {
        check_triangles(&triangles, keys.first().len(), Self::MAX_TRIANGLES)?;
        Ok(Self {
            survey: Survey::of(&keys, &triangles)?,
            keys,
            triangles,
        })
    }

    /// Returns the number of key frames.
    pub fn key_count(&self) -> usize {
        self.keys.count()
    }

    /// Returns the first key frame, which is always in memory.
    pub fn first(&self) -> &[Point] {
        self.keys.first()
    }

    /// Returns key frame `key`, counted from 0. Blocks while the key frame is read.
    ///
    /// In a [streamed](Self::streamed) animation, the oldest pushed key frame that is kept replaces a dropped one.
    ///
    /// # Errors
    /// The key frame cannot be read. Key frames held in memory never fail.
    ///
    /// # Panics
    /// If [`Self::new`] created the animation and `key` is not less than the number of key frames.
    pub fn key(&self, key: usize) -> Result<KeyFrame, KeyFrameError> {
        self.keys.get(key)
    }

    /// Returns the two key frames that `pose` blends, or `None` if the animation is not [streamed](Self::streamed). The
    /// caller can keep them after the animation has dropped them.
    pub fn streamed_keys(&self, pose: Pose) -> Option<[KeyFrame; 2]> {
        let KeyFrames::Streamed(keys) = &self.keys else {
            return None;
        };
        Some([0, 1].map(|after| keys.get(pose.key as usize + after)))
    }

    /// Returns all key frames, or `None` unless [`Self::new`] created the animation.
    pub fn held_keys(&self) -> Option<&[KeyFrame]> {
        match &self.keys {
            KeyFrames::Held(all) => Some(all),
            KeyFrames::Paged(_) | KeyFrames::Streamed(_) => None,
        }
    }

    /// Returns all key frames, and reads those that are not in memory.
    ///
    /// In a [streamed](Self::streamed) animation, the oldest pushed key frame that is kept replaces each dropped one.
    ///
    /// # Errors
    /// A key frame cannot be read.
    pub fn all_keys(&self) -> Result<Vec<KeyFrame>, KeyFrameError> {
        (0..self.key_count()).map(|key| self.key(key)).collect()
    }

    /// Returns the maximum number of key frames in memory besides the first, or `None` if [`Self::new`] created the
    /// animation.
    pub fn window(&self) -> Option<usize> {
        match &self.keys {
            KeyFrames::Held(_) => None,
            KeyFrames::Paged(window) => Some(window.capacity),
            KeyFrames::Streamed(_) => Some(Self::KEPT),
        }
    }

    /// Announces the times that will be played next, so that their key frames are read in the background. Never blocks.
    pub fn look_ahead(&self, times: impl IntoIterator<Item = f64>) {
        let keys = times.into_iter().flat_map(|time| self.pose(time).keys());
        self.keys.look_ahead(keys);
    }

    /// Returns up to `most` key frames that will be played next, with their numbers, so that a device can upload them
    /// early.
    ///
    /// Stops at the first key frame that is not read yet or could not be read. Empty unless the animation is
    /// [paged](Self::paged).
    pub fn upcoming(&self, most: usize) -> Vec<(usize, KeyFrame)> {
        match &self.keys {
            KeyFrames::Held(_) | KeyFrames::Streamed(_) => Vec::new(),
            KeyFrames::Paged(window) => window.upcoming(most),
        }
    }

    /// Number of recent key frames that a [streamed](Self::streamed) animation keeps.
    pub const KEPT: usize = StreamedKeys::KEPT;

    /// Returns whether key frames [arrive](Self::push) during playback.
    pub fn is_streamed(&self) -> bool {
        matches!(self.keys, KeyFrames::Streamed(_))
    }

    /// Appends the next key frame of a [streamed](Self::streamed) animation and returns its time.
    ///
    /// Only the last [`Self::KEPT`] key frames are kept. Each must be played before it is dropped.
    ///
    /// # Errors
    /// The number of vertices differs, or the animation is not streamed.
    pub fn push(&self, frame: impl Into<PointBuffer>) -> Result<f64, KeyFrameError> {
        let KeyFrames::Streamed(keys) = &self.keys else {
            let cause = "cannot push a key frame: the animation is not streamed";
            return Err(KeyFrameError(cause.to_owned()));
        };
        let frame = Arc::new(frame.into());
        check_pushed(frame.len(), self.vertex_count())?;
        Ok(keys.push(frame) as f64)
    }

    /// Adds memory for a future key frame, which [`Self::spare_frame`] returns.
    ///
    /// Ignored if the animation is not [streamed](Self::streamed), or if the number of vertices differs.
    pub fn add_spare_frame(&self, frame: PointBuffer) {
        if let KeyFrames::Streamed(keys) = &self.keys
            && frame.len() == self.vertex_count()
        {
            keys.add_spare(frame);
        }
    }

    /// Returns memory of a dropped key frame or from [`Self::add_spare_frame`], to fill and [push](Self::push).
    /// Returns `None` if no such memory is free.
    pub fn spare_frame(&self) -> Option<PointBuffer> {
        match &self.keys {
            KeyFrames::Streamed(keys) => keys.spare(),
            KeyFrames::Held(_) | KeyFrames::Paged(_) => None,
        }
    }

    /// Returns the vertex indices of all triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the number of vertices in each key frame.
    pub fn vertex_count(&self) -> usize {
        self.first().len()
    }

    /// Returns the number of triangles, including inactive ones.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Returns the number of [live](Self::is_live) triangles. A tree contains exactly these.
    pub fn live_count(&self) -> usize {
        self.triangles.len() - self.survey.never_active as usize
    }

    /// Returns the vertices and triangles that never move.
    pub fn static_parts(&self) -> &StaticParts {
        &self.survey.static_parts
    }

    /// Returns the number of live triangles that move. Every frame preprocesses their leaves.
    pub fn moving_count(&self) -> usize {
        match &self.keys {
            KeyFrames::Held(_) | KeyFrames::Paged(_) if self.key_count() == 1 => 0,
            // Static triangles are finite in all key frames, and therefore live.
            _ => self.live_count() - self.static_parts().triangle_count(),
        }
    }

    /// Returns the last time, in key frames.
    pub fn end(&self) -> f64 {
        (self.key_count() - 1) as f64
    }

    /// Returns the pose at `time`; see [`Pose::at`].
    ///
    /// After the last key frame of a [streamed](Self::streamed) animation, the pose extrapolates the last two key
    /// frames. Such poses are for tree builds only and are not traced.
    pub fn pose(&self, time: f64) -> Pose {
        let last = self.key_count() - 1;
        match self.keys {
            KeyFrames::Streamed(_) if last > 0 && time > last as f64 => Pose::beyond(time, last),
            _ => Pose::at(time, last + 1),
        }
    }

    /// Returns the box that a tree uses for `triangle` while the triangle is inactive.
    ///
    /// This is its box in the first key frame in which the triangle is active, or [`Aabb::EMPTY`] if there is none. In
    /// a [streamed](Self::streamed) animation, only the initial key frame counts, and a single point replaces an empty
    /// box. Rays never hit an inactive triangle, but the tree needs a leaf for the time when the triangle becomes
    /// active.
    pub fn fallback_box(&self, triangle: u32) -> Aabb {
        let inactive = &self.survey.fallback_boxes;
        if let Ok(i) = inactive.binary_search_by_key(&triangle, |s| s.0) {
            return inactive[i].1;
        }
        let vertices = self.triangles[triangle as usize];
        active_box(&corners(self.first(), vertices)).unwrap_or(Aabb::EMPTY)
    }

    /// Returns whether a tree must contain `triangle`: it is active in some key frame, or the animation is
    /// [streamed](Self::streamed), so that any triangle may become active.
    pub fn is_live(&self, triangle: u32) -> bool {
        self.survey.never_active == 0 || !self.fallback_box(triangle).is_empty()
    }

    /// Returns the box of `triangle` for a tree build over vertices at `positions`.
    ///
    /// This is the triangle's own box, or [`Self::fallback_box`] if the triangle is inactive at `positions`.
    #[inline]
    pub fn build_box(&self, positions: &[Point], triangle: u32) -> Aabb {
        let vertices = self.triangles[triangle as usize];
        self.box_of(&corners(positions, vertices), triangle)
    }

    #[inline]
    pub(crate) fn box_of(&self, corners: &Triangle, triangle: u32) -> Aabb {
        active_box(corners).unwrap_or_else(|| self.fallback_box(triangle))
    }

    /// Returns the exponent `k` for which scaling by `2^-k` keeps products from overflow and underflow.
    ///
    /// `k` is 0 if the largest finite `|coordinate|` of all key frames is 0 or within `[2^-10, 2^30]`, and else that
    /// coordinate's exponent, clamped to `-126..=126`. `k` is also 0 if some key frame has coordinates far beyond its
    /// typical size. In a [streamed](Self::streamed) animation, only the initial key frame counts.
    pub fn scale_exponent(&self) -> i32 {
        self.survey.scale_exponent
    }

    /// Returns the range of coordinates at `pose`. For a [pushed](Self::push) key frame, ignores the next one: no pose
    /// between them is traced.
    pub fn range(&self, pose: Pose) -> CoordinateRange {
        match &self.keys {
            KeyFrames::Streamed(keys) if pose.key > 0 => {
                keys.range(pose.key as usize, |frame| self.range_of(frame))
            }
            _ => CoordinateRange::at(&self.survey.ranges, pose),
        }
    }

    /// Returns the range of coordinates at `pose`, or `None` if a [pushed](Self::push) key frame was not measured yet.
    pub fn known_range(&self, pose: Pose) -> Option<CoordinateRange> {
        match &self.keys {
            KeyFrames::Streamed(keys) if pose.key > 0 => keys.known_range(pose.key as usize),
            _ => Some(CoordinateRange::at(&self.survey.ranges, pose)),
        }
    }

    /// Sets [`Self::range`] of a [pushed](Self::push) key frame to the range of `vertices`, for positions that were
    /// read back from a device. Keeps a range that is already known.
    pub fn measure(&self, pose: Pose, vertices: &[Point]) {
        if let KeyFrames::Streamed(keys) = &self.keys {
            keys.range(pose.key as usize, |_| self.range_of(vertices));
        }
    }

    fn range_of(&self, vertices: &[Point]) -> CoordinateRange {
        CoordinateRange::of(&Sizes::of(vertices), self.scale_exponent())
    }

    /// Returns, for each key frame, the smallest box that contains its finite vertices. Ignores [pushed](Self::push)
    /// key frames.
    pub fn key_bounds(&self) -> &[Aabb] {
        &self.survey.bounds
    }

    /// Returns the smallest box that contains every finite vertex of every key frame. Ignores [pushed](Self::push) key
    /// frames.
    pub fn bounds(&self) -> Aabb {
        let all = self.key_bounds().iter();
        all.fold(Aabb::EMPTY, |a, &b| a.union(b))
    }
}

fn check_keys(count: usize) -> Result<(), KeyFrameError> {
    if count > 0 {
        return Ok(());
    }
    let cause = "an animation needs at least one key frame";
    Err(KeyFrameError(cause.to_owned()))
}

fn check_fixed(marks: usize, vertices: usize) -> Result<(), KeyFrameError> {
    if marks == vertices {
        return Ok(());
    }
    let cause =
        format!("{marks} marks of fixed vertices were given, the scene has {vertices} vertices");
    Err(KeyFrameError(cause))
}

fn check_pushed(found: usize, vertices: usize) -> Result<(), KeyFrameError> {
    if found == vertices {
        return Ok(());
    }
    let cause = format!("{found} vertices were given, the scene has {vertices}");
    Err(KeyFrameError(cause))
}

#[inline]
fn active_box(corners: &Triangle) -> Option<Aabb> {
    is_active(corners).then(|| Aabb::of_triangle(corners))
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
    fn intermittent_triangle_keeps_a_build_box() {
        let mut broken = SQUARE;
        broken[3] = [f32::NAN; 3];
        let keys = vec![broken.to_vec(), SQUARE.to_vec()];
        let a = Animation::new(keys, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert_eq!(a.live_count(), 2);
        assert!(a.is_live(1) && !a.build_box(a.first(), 1).is_empty());
        let always = Animation::new(vec![broken.to_vec()], vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert_eq!(always.live_count(), 1);
        assert!(always.is_live(0) && !always.is_live(1));
        assert!(always.build_box(&broken, 1).is_empty());
    }

    #[test]
    fn overflowing_blend_uses_first_active_box() {
        let far = |x: f32| vec![[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        let a = Animation::new(vec![far(3e38), far(-3e38)], vec![[0, 1, 2]]).unwrap();
        let [start, middle, end] = [0.0, 0.5, 1.0].map(|time| a.at(time).unwrap());
        let positions: Vec<Point> = (0..3).map(|v| middle.vertex(v)).collect();
        assert!(a.is_live(0) && !is_active(&middle.corners(0)));
        let first = Aabb::of_triangle(&start.corners(0));
        assert_eq!(a.build_box(&positions, 0), first);
        assert_eq!(middle.build_box(0), first);
        assert_eq!(end.build_box(0).min[0], -3e38);
    }

    #[test]
    fn rejects_inconsistent_parts() {
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
                "triangle 0 has vertex index 4, but the vertex count is 4",
            ),
        ] {
            let e = Animation::new(keys, triangles).unwrap_err();
            assert_eq!(e.to_string(), says);
        }
        let none = Animation::paged(Arc::new(|_| Ok(SQUARE.to_vec())), 0, 4, vec![]);
        let says = "an animation needs at least one key frame";
        assert_eq!(none.unwrap_err().to_string(), says);
    }

    const REST: [Point; 3] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn at(x: f32) -> Vec<Point> {
        REST.map(|p| [p[0] + x, p[1], p[2]]).to_vec()
    }

    #[test]
    fn pushed_frames_play_and_extrapolate() {
        let streamed = Animation::streamed(at(0.0), &[false; 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!((streamed.key_count(), streamed.moving_count()), (1, 1));
        for step in 1..20 {
            let time = streamed.push(at(step as f32)).unwrap();
            let moment = streamed.at(time).unwrap();
            assert_eq!(moment.key_frames()[0], at(step as f32));
            let beyond = streamed.at(time + 1.5).unwrap();
            assert_eq!(beyond.vertex(0)[0], step as f32 + 1.5);
        }
        // Key frame 2 was dropped, so the blend uses the oldest that is kept.
        let (key, alpha) = (2, 1.25);
        let late = streamed.moment(Pose { key, alpha }).unwrap();
        assert_eq!(late.vertex(0)[0], 16.0);
        assert_eq!(streamed.at(0.0).unwrap().vertex(1), REST[1]);
        assert_eq!(streamed.spare_frame().map(|frame| frame.len()), Some(3));
        let spare = || streamed.spare_frame().map(|frame| frame[0][0]);
        while spare().is_some() {}
        streamed.add_spare_frame(at(7.0).into());
        assert_eq!([spare(), spare()], [Some(7.0), None]);
    }

    #[test]
    fn pushed_frames_are_unrestricted() {
        let mut rest = at(0.0);
        rest[0] = [f32::NAN; 3];
        let streamed = Animation::streamed(rest, &[false; 3], vec![[0, 1, 2]]).unwrap();
        assert!(streamed.is_live(0) && !streamed.fallback_box(0).is_empty());
        let mut far = at(0.0);
        far[2][1] = 1e30;
        let extreme = |frame| {
            streamed
                .range(streamed.pose(streamed.push(frame).unwrap()))
                .extreme
        };
        assert_eq!([at(1.0), far, at(2.0)].map(extreme), [false, true, false]);
    }

    #[test]
    fn rejects_mismatched_vertex_counts() {
        let no = |made: Result<Animation, KeyFrameError>| made.unwrap_err().to_string();
        assert_eq!(
            no(Animation::streamed(at(0.0), &[true; 2], Vec::new())),
            "2 marks of fixed vertices were given, the scene has 3 vertices"
        );
        let streamed = Animation::streamed(at(0.0), &[true; 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!(streamed.static_parts().triangle_count(), 1);
        assert_eq!(
            streamed.push(REST[1..].to_vec()).unwrap_err().to_string(),
            "2 vertices were given, the scene has 3"
        );
        let known = Animation::new(vec![at(0.0)], Vec::new()).unwrap();
        assert!(known.push(at(1.0)).is_err());
    }
}
