//! Shared code of the benchmarks: meshes, rays, and other crates behind one trait.
//!
//! A criterion group measures one stage on one mesh, by abvh and, except for conversions, by other crates. All
//! functions in a group use the same triangles or rays. The comments on the stages in `benches/stages.rs` state where
//! abvh and the other crates do different work.

mod mesh;
mod ours;
mod rays;
mod trees;

pub use mesh::{Mesh, meshes};
pub use ours::{Ours, Tracer, built};
pub use rays::{camera, shadow_rays};
pub use trees::{CrateTree, Node, sah_cost, trees};

use comfy_table::Table;
use criterion::Criterion;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::time::Duration;

/// Returns a configuration with few short samples, because medians are only compared within one run.
pub fn criterion() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args()
}

/// Returns the thread counts in `ABVH_THREADS` (`1,2,16`), or else 1 and the number of cores.
pub fn thread_counts() -> Vec<usize> {
    if let Ok(named) = std::env::var("ABVH_THREADS") {
        return named.split(',').filter_map(|n| n.parse().ok()).collect();
    }
    let all = std::thread::available_parallelism().map_or(1, usize::from);
    if all > 1 { vec![1, all] } else { vec![1] }
}

/// Starts a thread pool in which to run a measured closure.
///
/// # Panics
/// If the system refuses to start the threads.
pub fn pool(threads: usize) -> ThreadPool {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("the machine can start threads")
}

/// Returns the stage whose name is a prefix of an argument. If several arguments match, the first one counts. `None`
/// means all stages. Other arguments are criterion's options and their values.
pub fn selected_stage<'a>(
    stages: &[&'a str],
    arguments: impl IntoIterator<Item = String>,
) -> Option<&'a str> {
    let stage_of = |argument: String| stages.iter().copied().find(|s| argument.starts_with(s));
    arguments.into_iter().find_map(stage_of)
}

/// Prints a table on stderr. `|` separates the columns of `header`.
#[expect(clippy::print_stderr, reason = "a message to the user")]
pub fn print_table(title: &str, header: &str, rows: Vec<Vec<String>>) {
    let mut table = Table::new();
    table.set_header(header.split('|')).add_rows(rows);
    eprintln!("\n{title}\n{table}\n");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stage_is_found_among_options() {
        for (line, expected) in [
            ("--bench", None),
            ("--save-baseline before --bench", None),
            ("--save-baseline before refit --bench", Some("refit")),
            ("build/twist --bench", Some("build")),
        ] {
            let arguments = line.split(' ').map(str::to_owned);
            assert_eq!(selected_stage(&["build", "refit"], arguments), expected);
        }
    }
}
