//! A combination that could not be measured, with the reason.

use crate::args::{RaysName, backend_name, update_name};
use crate::choose::Ask;
use crate::rival::{Contest, OWN};
use crate::stop::Stop;
use serde::Serialize;
use std::fmt;

/// One combination without results. Fields are named as in [`Row`](super::Row).
#[derive(Clone, Debug, Serialize)]
pub(super) struct Failure {
    pub(super) scene: String,
    pub(super) backend: String,
    pub(super) update: String,
    /// Whether trees would have been built for predicted positions.
    predict: bool,
    pub(super) intersector: String,
    /// The kind of rays, unless they are a camera's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rays: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    builder_threads: Option<usize>,
    /// The reason.
    pub(super) error: String,
}

impl Failure {
    pub(super) fn new((spec, rays): (&str, RaysName), ask: &Ask<'_>, stop: &Stop) -> Self {
        Self {
            scene: spec.to_owned(),
            backend: backend_name(ask.backend).to_owned(),
            update: update_name(ask.update).to_owned(),
            predict: ask.predict,
            intersector: ask.intersector.to_string(),
            rays: (rays == RaysName::Random).then_some("random"),
            builder_threads: ask.builder_threads,
            error: stop.to_string(),
        }
    }

    pub(super) fn of_rival((spec, rays): (&str, RaysName), contest: Contest, stop: &Stop) -> Self {
        Self {
            scene: spec.to_owned(),
            backend: contest.rival.name.to_owned(),
            update: contest.upkeep.to_string(),
            predict: false,
            intersector: OWN.to_owned(),
            rays: (rays == RaysName::Random).then_some("random"),
            builder_threads: None,
            error: stop.to_string(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            scene,
            backend,
            update,
            intersector,
            ..
        } = self;
        let name = format!("{scene} {backend} {update} {intersector}");
        let rays = self
            .rays
            .map_or(String::new(), |rays| format!(" {rays} rays"));
        write!(f, "{name}{rays} failed: {}", self.error)
    }
}
