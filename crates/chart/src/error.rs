//! What can go wrong between points and files.

use plotters::drawing::DrawingAreaErrorKind;

/// Why there is no chart.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChartError {
    /// The picture could not be drawn.
    #[error("cannot draw the chart: {0}")]
    Draw(#[from] DrawingAreaErrorKind<std::io::Error>),
    /// The table of points could not be written.
    #[error("cannot write the points as CSV: {0}")]
    Csv(String),
    /// The points could not be written as JSON.
    #[error("cannot write the points as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

/// Shorthand.
pub type Result<T> = std::result::Result<T, ChartError>;
