//! A folder for one run, and what may be demanded of a run.

use integration::program;
use libtest_mimic::Failed;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

/// A folder that goes away; the program runs in it.
pub(crate) struct Sandbox(tempfile::TempDir);

/// One finished run.
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    words: String,
}

impl Sandbox {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder can be had"))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file of input, making folders on the way.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().expect("inside the sandbox"))
            .expect("folders can be made");
        fs::write(path, bytes).expect("input can be written");
    }

    /// Runs the program with words separated by blanks.
    pub(crate) fn run(&self, words: &str) -> Run {
        Run::of(&program::run(self.path(), words.split_whitespace()), words)
    }

    /// Likewise, in an environment where `variables` have these values.
    pub(crate) fn run_where(&self, words: &str, variables: &[(&str, &OsStr)]) -> Run {
        let output = program::run_where(self.path(), words.split_whitespace(), variables);
        Run::of(&output, words)
    }

    /// Every file below, sorted, as paths relative to the sandbox; manifests and journals of runs are left out.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let mut files = self.all_files();
        files.retain(|f| {
            !f.file_name()
                .is_some_and(|n| n.to_string_lossy().starts_with("abvh-run"))
        });
        files
    }

    /// Likewise, with those.
    pub(crate) fn all_files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        collect(self.path(), &mut files);
        files.sort();
        let relative = |p: PathBuf| p.strip_prefix(self.path()).map(Path::to_owned);
        files.into_iter().filter_map(|p| relative(p).ok()).collect()
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        let path = self.path().join(name);
        fs::read(&path).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub(crate) fn json(&self, name: &str) -> Result<serde_json::Value, Failed> {
        Ok(serde_json::from_slice(&self.read(name))?)
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the sandbox can be read") {
        let path = entry.expect("the sandbox can be read").path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}

impl Run {
    pub(crate) fn of(output: &Output, words: &str) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self {
            code: output.status.code(),
            stdout: text(&output.stdout),
            stderr: text(&output.stderr),
            words: words.to_owned(),
        }
    }

    /// The run did what was asked.
    pub(crate) fn succeeds(self) -> Result<Self, Failed> {
        if self.code == Some(0) {
            return Ok(self);
        }
        Err(self.complain("should succeed"))
    }

    /// The run ended with `code` and one clear line that says all of `says`.
    pub(crate) fn fails(self, code: i32, says: &[&str]) -> Result<(), Failed> {
        if self.code != Some(code) {
            return Err(self.complain(&format!("should exit {code}")));
        }
        let mut lines = self.stderr.lines();
        let (Some(line), None) = (lines.next(), lines.next()) else {
            return Err(self.complain("should say one line"));
        };
        if !line.starts_with("abvh: ") {
            return Err(self.complain("should start with `abvh: `"));
        }
        if let Some(word) = says.iter().find(|&&word| !line.contains(word)) {
            return Err(self.complain(&format!("should say `{word}`")));
        }
        Ok(())
    }

    fn complain(&self, what: &str) -> Failed {
        let Self {
            words,
            code,
            stdout,
            stderr,
        } = self;
        format!("abvh {words}\n{what}\nexit {code:?}\nstderr: {stderr}\nstdout: {stdout}").into()
    }
}

/// A square of two triangles, as OBJ.
pub(crate) const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

/// A trial whose body gets a fresh sandbox.
pub(crate) fn trial(
    name: &str,
    body: impl FnOnce(&Sandbox) -> Result<(), Failed> + Send + 'static,
) -> libtest_mimic::Trial {
    libtest_mimic::Trial::test(name, move || body(&Sandbox::new()))
}

/// `Err(message)` unless `condition` holds.
pub(crate) fn ensure(condition: bool, message: impl FnOnce() -> String) -> Result<(), Failed> {
    if condition {
        return Ok(());
    }
    Err(message().into())
}
