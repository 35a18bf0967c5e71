//! Runs the program as a user would.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// Returns the folder of this profile's artefacts, such as `target/debug`.
fn profile_dir() -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own path");
    let mut folders = test.ancestors().skip(1);
    let deps = folders.find(|p| p.file_name() == Some(OsStr::new("deps")));
    let profile = deps.and_then(Path::parent);
    profile.expect("cargo puts tests into `deps`").to_owned()
}

/// Returns the target directory.
pub fn target_dir() -> PathBuf {
    let profile = profile_dir();
    profile.parent().expect("profiles have a folder").to_owned()
}

/// Returns the path of the program, built with this test's profile. Cargo passes binary paths only to tests of the same
/// package. So the first call has cargo build the test `version` of `crates/cli`. The command names no package, so
/// cargo enables the same features as `cargo test`, and nothing is built twice.
pub fn abvh() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let folder = profile_dir();
        let profile = match folder.file_name().and_then(OsStr::to_str) {
            Some("debug") | None => "dev",
            Some(name) => name,
        };
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| env!("CARGO").into());
        let words =
            format!("test --quiet --no-run --test version --profile {profile} --target-dir");
        let mut command = Command::new(cargo);
        command.args(words.split(' ')).arg(target_dir());
        let command = command.current_dir(crate::scenes::workspace());
        let built = command.status().expect("cargo runs");
        assert!(built.success(), "the program does not build");
        folder.join(format!("abvh{}", std::env::consts::EXE_SUFFIX))
    })
}

/// Runs the program in `folder` with these environment variables, and waits for it.
pub fn run_where<S: AsRef<OsStr>>(
    folder: &Path,
    args: impl IntoIterator<Item = S>,
    variables: &[(&str, &OsStr)],
) -> Output {
    let mut command = Command::new(abvh());
    command.args(args).envs(variables.iter().copied());
    let output = command.current_dir(folder).output();
    output.expect("the program starts")
}
