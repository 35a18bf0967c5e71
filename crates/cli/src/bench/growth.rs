//! Time, memory and start-up against triangles, as a picture.

use super::{Report, Row};
use crate::chart;
use crate::memory::DeviceMemory;
use crate::stop::Stop;
use output::plot::{self, Growth, GrowthPoint};

pub(super) fn svg(report: &Report) -> Result<String, Stop> {
    let mut machine = chart::machine();
    report
        .rows
        .iter()
        .for_each(|row| chart::add_adapter(&mut machine, row));
    let growth = Growth {
        title: "Time, memory and start-up against triangles".to_owned(),
        machine,
        size: report.size,
        points: report.rows.iter().map(point).collect(),
    };
    plot::growth_svg(&growth).map_err(Stop::failed)
}

fn point(row: &Row) -> GrowthPoint {
    GrowthPoint {
        triangles: row.triangles as u64,
        update: row.update.to_owned(),
        layout: row.layout.to_owned(),
        frame_ms: row.median("wall_ms"),
        first_ms: row.first_ms,
        device_bytes: row.memory.map(DeviceMemory::total),
    }
}
