//! A combination that could not be measured, with the reason.

use crate::measure::{Contender, ContenderNames, RayKind};
use crate::stop::Stop;
use serde::Serialize;
use std::fmt;

/// One combination without results. Fields are named as in the rows of results.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FailedRun {
    pub(super) scene: String,
    pub(super) backend: &'static str,
    pub(super) update: &'static str,
    /// Whether trees would have been built for predicted positions.
    predict: bool,
    pub(super) intersector: &'static str,
    pub(super) layout: &'static str,
    /// The kind of rays, unless they are a camera's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rays: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    builder_threads: Option<usize>,
    /// The reason.
    error: String,
}

impl FailedRun {
    pub(super) fn new(scene: &str, rays: RayKind, contender: &Contender, stop: &Stop) -> Self {
        let ContenderNames {
            backend,
            update,
            intersector,
            layout,
        } = contender.names();
        let tracer = match contender {
            Contender::Ours(tracer) => Some(tracer),
            Contender::Rival(_) => None,
        };
        Self {
            scene: scene.to_owned(),
            backend,
            update,
            predict: tracer.is_some_and(|tracer| tracer.predict),
            intersector,
            layout,
            rays: rays.unless_camera(),
            builder_threads: tracer.and_then(|tracer| tracer.device.builder_threads),
            error: stop.to_string(),
        }
    }
}

impl fmt::Display for FailedRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = [
            &*self.scene,
            self.backend,
            self.update,
            self.intersector,
            self.layout,
        ];
        let name = words.join(" ");
        let rays = self
            .rays
            .map_or(String::new(), |rays| format!(" {rays} rays"));
        write!(f, "{name}{rays} failed: {}", self.error)
    }
}
