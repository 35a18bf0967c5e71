//! What is known of a scene and of its frames, as the statistics file says it.

use crate::memory;
use backend::DeviceBytes;
use output::{FrameStats, SceneFacts, rounded};
use pipeline::FrameRecord;
use scene::Scene;

/// The command line, program first.
pub(crate) fn command_line() -> Vec<String> {
    std::env::args_os()
        .map(|a| a.to_string_lossy().into_owned())
        .collect()
}

/// The row of a frame that is done just now.
pub(crate) fn row(record: &FrameRecord) -> FrameStats {
    let (times, report) = (&record.report.times, &record.report);
    let adopted = record.adopted;
    let build_ms = adopted.map(|a| a.build_ms).or(times.rebuild_ms);
    FrameStats {
        frame: record.frame.index as usize,
        time: rounded(record.frame.time),
        interpolate_ms: times.interpolate_ms.map(rounded),
        preprocess_ms: times.preprocess_ms.map(rounded),
        rebuild_ms: times.rebuild_ms.map(rounded),
        refit_ms: times.refit_ms.map(rounded),
        trace_primary_ms: times.trace_primary_ms.map(rounded),
        trace_shadow_ms: times.trace_shadow_ms.map(rounded),
        device_ms: Some(rounded(times.device_ms)),
        wall_ms: Some(rounded(record.wall_ms)),
        build_wait_ms: Some(rounded(record.build_wait_ms)),
        tree_generation: record.tree_generation.0,
        tree_age_frames: record.tree_age_frames,
        adopted: adopted.is_some() || record.made,
        rejected: record.rejected.is_some(),
        build_ms: build_ms.map(rounded),
        convert_ms: adopted.map(|a| rounded(a.convert_ms)),
        upload_bytes: adopted.map_or(0, |a| a.upload_bytes),
        readback_bytes: report.readback_bytes,
        sah_ratio: record.sah_ratio.map(rounded),
        sah_cost: report.sah_cost.map(rounded),
        hits: report.hits,
        blocked: report.blocked,
        inactive: report.inactive,
        degenerate: report.degenerate,
        settled: report.settled,
        host_bytes: memory::resident_bytes(),
        device_bytes: record.device_bytes.map(DeviceBytes::total),
    }
}

pub(crate) fn scene_facts(scene: &Scene) -> SceneFacts {
    let (animation, facts) = (&scene.animation, &scene.facts);
    SceneFacts {
        name: scene.name.clone(),
        keys: animation.key_count(),
        vertices: animation.vertex_count(),
        triangles: animation.triangle_count(),
        live: animation.live_count(),
        moving: animation.moving_count(),
        facts: serde_json::json!({
            "format": facts.format,
            "files": facts.files.iter().map(|f| f.to_string_lossy()).collect::<Vec<_>>(),
            "clip": facts.clip,
            "seconds_per_key": facts.seconds_per_key,
            "notes": facts.notes,
        }),
    }
}
