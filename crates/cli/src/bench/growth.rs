//! Time, memory and start-up against triangles, as a picture.

use super::{Report, Row};
use crate::memory::DeviceMemory;
use crate::stop::Stop;
use chart::{Adapter, Growth, GrowthPoint, Machine};

pub(super) fn svg(report: &Report) -> Result<String, Stop> {
    let mut adapters: Vec<Adapter> = report.rows.iter().map(adapter).collect();
    adapters.dedup();
    let growth = Growth {
        title: "Time, memory and start-up against triangles".to_owned(),
        machine: Machine {
            cpu: report.cpu.clone(),
            version: report.version.to_owned(),
            date: time::OffsetDateTime::now_utc().date().to_string(),
            adapters,
        },
        size: report.size,
        points: report.rows.iter().map(point).collect(),
    };
    chart::growth_svg(&growth).map_err(Stop::failed)
}

fn adapter(row: &Row) -> Adapter {
    Adapter {
        backend: row.backend.to_owned(),
        adapter: row.adapter.clone(),
        driver: row.driver.clone().unwrap_or_default(),
    }
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
