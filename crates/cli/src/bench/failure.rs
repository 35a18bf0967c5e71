//! A combination that could not be measured, with the reason.

use crate::error::CliError;
use crate::measure::{Contender, ContenderNames, MeasuredRays};
use serde::Serialize;
use std::fmt;

/// One combination without results. Fields are named as in the rows of results.
#[derive(Clone, Debug, Serialize)]
pub(super) struct FailedRun {
    pub(super) scene: String,
    pub(super) backend: &'static str,
    pub(super) update: &'static str,
    pub(super) intersector: &'static str,
    /// The kind of rays, unless they are a camera's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) rays: Option<&'static str>,
    /// The reason.
    error: String,
}

impl FailedRun {
    pub(super) fn new(
        scene: &str,
        rays: MeasuredRays,
        contender: &Contender,
        error: &CliError,
    ) -> Self {
        let ContenderNames {
            backend,
            update,
            intersector,
        } = contender.names();
        Self {
            scene: scene.to_owned(),
            backend,
            update,
            intersector,
            rays: rays.unless_camera(),
            error: error.to_string(),
        }
    }
}

impl fmt::Display for FailedRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = [&*self.scene, self.backend, self.update, self.intersector];
        let name = words.join(" ");
        let rays = self
            .rays
            .map_or(String::new(), |rays| format!(" {rays} rays"));
        write!(f, "{name}{rays} failed: {}", self.error)
    }
}
