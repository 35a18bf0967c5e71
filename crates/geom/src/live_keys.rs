//! Key frames that arrive during playback.

use crate::key_frames::KeyFrames;
use crate::{Animation, KeyFrame, KeyFrameError, Point, PointBuffer, Range, lock};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

#[derive(Debug)]
pub(crate) struct LiveKeys {
    pub(crate) first: KeyFrame,
    state: Mutex<Recent>,
}

#[derive(Debug, Default)]
struct Recent {
    /// Number of the newest key frame.
    last: usize,
    /// The most recent key frames, oldest first, without key frame 0.
    kept: VecDeque<LiveKey>,
    /// Dropped key frames, which readers may still use.
    dropped: Vec<KeyFrame>,
}

#[derive(Debug)]
struct LiveKey {
    frame: KeyFrame,
    /// Range of coordinates, once it was requested.
    range: Option<Range>,
}

impl LiveKeys {
    /// Number of recent key frames that are kept.
    pub(crate) const KEPT: usize = 4;

    pub(crate) fn new(first: KeyFrame) -> Self {
        Self {
            first,
            state: Mutex::default(),
        }
    }

    pub(crate) fn key_count(&self) -> usize {
        lock(&self.state).last + 1
    }

    /// Appends the next key frame and returns its number.
    pub(crate) fn push(&self, frame: KeyFrame) -> usize {
        let mut state = lock(&self.state);
        state.last += 1;
        state.kept.push_back(LiveKey { frame, range: None });
        if state.kept.len() > Self::KEPT {
            let oldest = state.kept.pop_front();
            state.dropped.extend(oldest.map(|key| key.frame));
        }
        state.last
    }

    pub(crate) fn add_spare(&self, frame: PointBuffer) {
        lock(&self.state).dropped.push(Arc::new(frame));
    }

    pub(crate) fn spare(&self) -> Option<PointBuffer> {
        let dropped = &mut lock(&self.state).dropped;
        let is_free = |frame: &KeyFrame| Arc::strong_count(frame) == 1;
        let free = dropped.iter().position(is_free)?;
        Arc::into_inner(dropped.swap_remove(free))
    }

    /// Returns a key frame. If it was dropped, returns the oldest that is kept: only tree builds request key frames so
    /// late.
    pub(crate) fn get(&self, key: usize) -> KeyFrame {
        let found = lock(&self.state)
            .find(key)
            .map(|key| Arc::clone(&key.frame));
        found.unwrap_or_else(|| Arc::clone(&self.first))
    }

    /// Returns the range of coordinates of a key frame that was pushed, if it was computed before.
    pub(crate) fn known_range(&self, key: usize) -> Option<Range> {
        lock(&self.state).find(key)?.range
    }

    /// Returns the range of coordinates of a key frame, and computes it by `look` if necessary.
    pub(crate) fn range(&self, key: usize, look: impl FnOnce(&KeyFrame) -> Range) -> Range {
        self.known_range(key).unwrap_or_else(|| {
            let range = look(&self.get(key));
            if let Some(key) = lock(&self.state).find(key) {
                key.range = Some(range);
            }
            range
        })
    }
}

impl Recent {
    /// Returns a key frame, or the oldest that is kept if it was dropped. Returns `None` for key frame 0.
    fn find(&mut self, key: usize) -> Option<&mut LiveKey> {
        let back = self.last.saturating_sub(key);
        let at = self.kept.len().saturating_sub(back + 1);
        self.kept.get_mut(at).filter(|_| key > 0)
    }
}

impl Animation {
    /// Creates an animation whose key frames [arrive](Self::push) during playback, after `first`.
    ///
    /// Vertices marked `fixed` have the same bits in all key frames. The others may move anywhere.
    ///
    /// # Errors
    /// Those of [`Self::new`], or `fixed` does not have one mark per vertex.
    pub fn live(
        first: Vec<Point>,
        fixed: &[bool],
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, KeyFrameError> {
        check_count(fixed.len(), first.len())?;
        let first: KeyFrame = Arc::new(first.into());
        let keys = LiveKeys::new(Arc::clone(&first));
        let mut live = Self::over(
            Arc::clone(&first),
            KeyFrames::Live(Arc::new(keys)),
            triangles,
        )?;
        live.survey.expect_others(&first, &live.triangles, fixed);
        Ok(live)
    }

    /// Appends the next key frame of a [live](Self::live) animation and returns its time.
    ///
    /// Only the last [`Self::KEPT`] key frames are kept, so each must be played before many others are pushed.
    ///
    /// # Errors
    /// The number of vertices differs, or the animation is not live.
    pub fn push(&self, frame: impl Into<PointBuffer>) -> Result<f64, KeyFrameError> {
        let KeyFrames::Live(live) = &self.keys else {
            let cause = "all key frames of this animation are known";
            return Err(KeyFrameError(cause.to_owned()));
        };
        let frame = Arc::new(frame.into());
        check_count(frame.len(), self.vertex_count())?;
        Ok(live.push(frame) as f64)
    }

    /// Number of recent key frames that a [live](Self::live) animation keeps.
    pub const KEPT: usize = LiveKeys::KEPT;

    /// Adds memory for a future key frame, which [`Self::spare_frame`] returns.
    ///
    /// Ignored if the animation is not [live](Self::live), or if the number of vertices differs.
    pub fn add_spare_frame(&self, frame: PointBuffer) {
        if let KeyFrames::Live(live) = &self.keys
            && frame.len() == self.vertex_count()
        {
            live.add_spare(frame);
        }
    }

    /// Returns whether key frames [arrive](Self::push) during playback.
    pub fn is_arriving(&self) -> bool {
        matches!(self.keys, KeyFrames::Live(_))
    }

    /// Returns memory of a dropped key frame, to fill and [push](Self::push) as the next one.
    pub fn spare_frame(&self) -> Option<PointBuffer> {
        match &self.keys {
            KeyFrames::Live(live) => live.spare(),
            KeyFrames::Held(_) | KeyFrames::Streamed(_) => None,
        }
    }
}

fn check_count(found: usize, vertices: usize) -> Result<(), KeyFrameError> {
    match found == vertices {
        true => Ok(()),
        false => Err(KeyFrameError(format!(
            "{found} vertices were given, the scene has {vertices}"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pose;

    const REST: [Point; 3] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn at(x: f32) -> Vec<Point> {
        REST.map(|p| [p[0] + x, p[1], p[2]]).to_vec()
    }

    #[test]
    fn frames_are_played_as_they_were_pushed_and_trees_look_beyond_the_last() {
        let live = Animation::live(at(0.0), &[false; 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!((live.key_count(), live.moving_count()), (1, 1));
        for step in 1..20 {
            let time = live.push(at(step as f32)).unwrap();
            let moment = live.at(time).unwrap();
            assert_eq!(moment.key_frames()[0], at(step as f32));
            let beyond = live.at(time + 1.5).unwrap();
            assert_eq!(beyond.vertex(0)[0], step as f32 + 1.5);
        }
        // Key frame 2 was dropped, so the blend uses the oldest that is kept.
        let (key, alpha) = (2, 1.25);
        let late = live.moment(Pose { key, alpha }).unwrap();
        assert_eq!(late.vertex(0)[0], 16.0);
        assert_eq!(live.at(0.0).unwrap().vertex(1), REST[1]);
        assert_eq!(live.spare_frame().map(|frame| frame.len()), Some(3));
        let spare = || live.spare_frame().map(|frame| frame[0][0]);
        while spare().is_some() {}
        live.add_spare_frame(at(7.0).into());
        assert_eq!([spare(), spare()], [Some(7.0), None]);
    }

    #[test]
    fn what_comes_may_reach_anywhere_and_become_active() {
        let mut rest = at(0.0);
        rest[0] = [f32::NAN; 3];
        let live = Animation::live(rest, &[false; 3], vec![[0, 1, 2]]).unwrap();
        assert!(live.is_live(0) && !live.fallback_corner(0).is_empty());
        let mut far = at(0.0);
        far[2][1] = 1e30;
        let extreme = |frame| live.range(live.pose(live.push(frame).unwrap())).extreme;
        assert_eq!([at(1.0), far, at(2.0)].map(extreme), [false, true, false]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let no = |made: Result<Animation, KeyFrameError>| made.unwrap_err().to_string();
        let says = "2 vertices were given, the scene has 3";
        assert_eq!(no(Animation::live(at(0.0), &[true; 2], Vec::new())), says);
        let live = Animation::live(at(0.0), &[true; 3], vec![[0, 1, 2]]).unwrap();
        assert_eq!(live.static_parts().triangle_count(), 1);
        assert_eq!(live.push(REST[1..].to_vec()).unwrap_err().to_string(), says);
        let known = Animation::new(vec![at(0.0)], Vec::new()).unwrap();
        assert!(known.push(at(1.0)).is_err());
    }
}
