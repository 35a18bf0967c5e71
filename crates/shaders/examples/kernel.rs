//! Prints a composed kernel: `cargo run -p abvh-shaders --example kernel -- trace_camera watertight`. Without
//! arguments, prints all names.
//!
//! With `fused` as the last argument, prints the text for devices whose fused multiply-add rounds once.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "it prints")]

use shaders::{KERNELS, Kernel};
use std::process::ExitCode;

/// Returns whether a kernel has this entry point and lists all `values` as intersectors, except the argument `fused`.
fn matches(kernel: &Kernel, entry: &str, values: &[String]) -> bool {
    let serves = |value: &String| kernel.intersectors.contains(&value.as_str());
    kernel.entry == entry && values.iter().filter(|v| *v != "fused").all(serves)
}

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let Some((entry, values)) = arguments.split_first() else {
        for kernel in KERNELS {
            println!("{}", kernel.name.replace('.', " "));
        }
        return ExitCode::SUCCESS;
    };
    let all = KERNELS.iter();
    let found: Vec<_> = all.filter(|k| matches(k, entry, values)).collect();
    let [kernel] = found[..] else {
        let advice = match found.len() {
            0 => "no kernel has this name: correct it".to_owned(),
            n => format!("{n} kernels have this name: also name the intersector"),
        };
        eprintln!("{advice}, or give no argument to list all");
        return ExitCode::FAILURE;
    };
    let fused = kernel.fused.filter(|_| values.iter().any(|v| v == "fused"));
    print!("{}", fused.unwrap_or(kernel.code).wgsl);
    ExitCode::SUCCESS
}
