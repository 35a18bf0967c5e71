//! State of a tracer.

use crate::builder::TracerBuilder;
use crate::disposal::Disposal;
use crate::loaded::{QueryResult, ResidentScene};
use crate::query::{QueryId, StepId};
use crate::{Error, Result, Statistics};
use backend::DeviceKind;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

/// State that is changed by steps and by reading results.
pub(crate) struct TracerState {
    pub(crate) current: ResidentScene,
    /// Scenes from before replacements, while they have results.
    pub(crate) former: Vec<ResidentScene>,
    pub(crate) tracer_builder: TracerBuilder,
    /// Number of committed replacements.
    pub(crate) commits: u64,
    /// Number of the newest committed replacement of each mesh, counted from 1.
    pub(crate) replaced: BTreeMap<usize, u64>,
    pub(crate) kind: DeviceKind,
    /// Number of the step begun last. Each tracer counts from a different number, so no two steps have the same number.
    pub(crate) steps: u64,
    /// Number of the step submitted last.
    pub(crate) submitted: u64,
    /// Shared with the replacements of this tracer.
    pub(crate) disposal: Arc<Disposal>,
}

impl TracerState {
    /// Returns the scene, current or former, in which a query was traced, and the index of its result there.
    pub(crate) fn find(
        &mut self,
        step: StepId,
        query: QueryId,
    ) -> Result<(&mut ResidentScene, usize)> {
        let is_requested = |result: &QueryResult| result.query == query && query.step == step;
        let mut scenes = std::iter::once(&mut self.current).chain(&mut self.former);
        let found = scenes.find_map(|loaded| {
            let index = loaded.results.iter().position(is_requested)?;
            Some((loaded, index))
        });
        found.ok_or(Error::NoResult)
    }

    /// Returns the newest statistics.
    pub(crate) fn statistics(&self) -> Option<Statistics> {
        let scenes = std::iter::once(&self.current).chain(&self.former);
        let all = scenes.filter_map(|loaded| loaded.last);
        // A scene begins with a copy of the former scene's statistics. The former scene may have newer statistics.
        all.max_by_key(|statistics| statistics.generation)
    }

    /// Drops the results of all steps except `step`, which is submitted now, and the step submitted before it.
    pub(crate) fn submitted(&mut self, step: StepId) {
        let before = std::mem::replace(&mut self.submitted, step.0);
        self.keep_from(before);
    }

    /// Drops the results of steps before `oldest`, and former scenes without other results.
    pub(crate) fn keep_from(&mut self, oldest: u64) {
        // Scenes that are dropped may have the newest statistics.
        self.current.last = self.statistics();
        self.current.keep_from(oldest);
        let is_done = |loaded: &mut ResidentScene| !loaded.keep_from(oldest);
        for done in self.former.extract_if(.., is_done) {
            self.disposal.begin(move || drop(done));
        }
    }
}

impl fmt::Debug for TracerState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TracerState").finish_non_exhaustive()
    }
}
