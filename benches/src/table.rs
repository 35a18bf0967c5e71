//! Tables on stderr: facts beside the timings.

use comfy_table::Table;

/// Prints a titled table.
#[expect(clippy::print_stderr, reason = "facts for whoever runs the benchmark")]
pub fn print_table(title: &str, header: &[&str], rows: Vec<Vec<String>>) {
    let mut table = Table::new();
    table.set_header(header.to_vec()).add_rows(rows);
    eprintln!("\n{title}\n{table}\n");
}
