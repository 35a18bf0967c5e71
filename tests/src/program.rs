//! The program as a person runs it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The folder of this profile's artefacts, such as `target/debug`.
fn profile_dir() -> PathBuf {
    let test = std::env::current_exe().expect("a test knows where it lies");
    let mut folders = test.ancestors().skip(1);
    let deps = folders.find(|p| p.file_name() == Some(OsStr::new("deps")));
    let profile = deps.and_then(Path::parent);
    profile.expect("cargo puts tests into `deps`").to_owned()
}

/// The target directory.
///
/// # Panics
/// If the test does not lie where cargo puts tests; likewise below.
#[must_use]
pub fn target_dir() -> PathBuf {
    let profile = profile_dir();
    profile.parent().expect("profiles have a folder").to_owned()
}

/// The program, built with this test's profile. Cargo names binaries to tests
/// of their own package only, so the first caller asks cargo to build it.
///
/// # Panics
/// If it cannot be built.
#[must_use]
pub fn abvh() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let folder = profile_dir();
        let profile = match folder.file_name().and_then(OsStr::to_str) {
            Some("debug") | None => "dev",
            Some(name) => name,
        };
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| env!("CARGO").into());
        let built = Command::new(cargo)
            .args([
                "build",
                "--quiet",
                "--package",
                "abvh-cli",
                "--profile",
                profile,
            ])
            .arg("--target-dir")
            .arg(target_dir())
            .current_dir(crate::scenes::workspace())
            .status()
            .expect("cargo runs");
        assert!(built.success(), "the program does not build");
        folder.join(format!("abvh{}", std::env::consts::EXE_SUFFIX))
    })
}

/// Runs the program in `folder` and waits for it.
///
/// # Panics
/// If it cannot be started.
pub fn run<S: AsRef<OsStr>>(folder: &Path, args: impl IntoIterator<Item = S>) -> Output {
    run_where(folder, args, &[])
}

/// Likewise, in an environment where `variables` have these values.
///
/// # Panics
/// If it cannot be started.
pub fn run_where<S: AsRef<OsStr>>(
    folder: &Path,
    args: impl IntoIterator<Item = S>,
    variables: &[(&str, &OsStr)],
) -> Output {
    Command::new(abvh())
        .args(args)
        .envs(variables.iter().copied())
        .current_dir(folder)
        .output()
        .expect("the program starts")
}
