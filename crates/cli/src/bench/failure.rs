//! A combination that could not be measured, with the reason.

use crate::args::{RaysName, update_name, word};
use crate::choose::Ask;
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
    pub(super) layout: String,
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
            backend: word(&ask.backend),
            update: update_name(ask.update).to_owned(),
            predict: ask.predict,
            intersector: ask.method.intersector.to_string(),
            layout: word(&ask.method.layout),
            rays: (rays == RaysName::Random).then_some("random"),
            builder_threads: ask.builder_threads,
            error: stop.to_string(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = [&self.scene, &self.backend, &self.update];
        let how = [&self.intersector, &self.layout];
        let words = names.into_iter().chain(how).map(String::as_str);
        let rays = self
            .rays
            .map_or(String::new(), |rays| format!(" {rays} rays"));
        let name = words.collect::<Vec<_>>().join(" ");
        write!(f, "{name}{rays} failed: {}", self.error)
    }
}
