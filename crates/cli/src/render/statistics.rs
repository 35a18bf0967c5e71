//! The JSON of `--stats`.

use crate::console;
use crate::error::CliError;
use output::overview;
use pipeline::FrameRecord;
use serde_json::{Value, json};
use std::path::Path;

/// Returns statistics with these records, in the order of frames.
pub(crate) fn with_records(mut stats: Value, records: &[FrameRecord]) -> Value {
    let mut records = records.to_vec();
    records.sort_by_key(|record| record.frame.index);
    stats["summary"] = json!(overview(&records));
    stats["frames"] = json!(records);
    stats["command_line"] = json!(crate::machine::command_line());
    stats
}

/// Writes statistics to a file, or to standard output for `-`.
pub(crate) fn write(file: &Path, stats: &Value) -> Result<(), CliError> {
    if file.as_os_str() == "-" {
        console::print_json(stats)
    } else {
        Ok(output::write_json(file, stats)?)
    }
}
