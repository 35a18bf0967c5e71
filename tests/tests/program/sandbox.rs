//! A temporary folder for the runs of a test, and assertions on runs.

use integration::program;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

/// A temporary folder in which the program runs.
pub(crate) struct Sandbox(tempfile::TempDir);

/// A finished run.
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    words: String,
}

impl Sandbox {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder is available"))
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes an input file and creates its parent folders.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    pub(crate) fn remove(&self, name: &str) {
        fs::remove_file(self.path().join(name)).unwrap();
    }

    /// Runs the program with arguments separated by blanks.
    pub(crate) fn run(&self, words: &str) -> Run {
        self.run_where(words, &[])
    }

    /// Runs the program with these environment variables.
    pub(crate) fn run_where(&self, words: &str, variables: &[(&str, &OsStr)]) -> Run {
        let output = program::run_where(self.path(), words.split_whitespace(), variables);
        Run::of(&output, words)
    }

    /// Runs the program under an `ulimit`, such as `-v KILOBYTES` of address space.
    #[cfg(target_os = "linux")]
    pub(crate) fn run_within(&self, limit: &str, words: &str) -> Run {
        let limited = format!("ulimit {limit}; exec \"$0\" \"$@\"");
        let mut command = Command::new("sh");
        command.args(["-c", &limited]).arg(program::abvh());
        // glibc reserves 64 MB of address space when a thread first allocates, which may be at any moment.
        command.env("MALLOC_ARENA_MAX", "1");
        let command = command.args(words.split(' ')).current_dir(self.path());
        Run::of(&command.output().unwrap(), words)
    }

    /// Starts the program without waiting. `to` creates its standard output and standard error.
    pub(crate) fn spawn(&self, words: &str, to: fn() -> Stdio) -> Child {
        let mut command = Command::new(program::abvh());
        let command = command.args(words.split(' ')).current_dir(self.path());
        command.stdout(to()).stderr(to()).spawn().unwrap()
    }

    /// Runs the program, which must succeed.
    pub(crate) fn run_ok(&self, words: &str) -> Run {
        self.run(words).succeeds()
    }

    /// Runs the program, which must succeed, and returns the JSON file that `option` requests.
    pub(crate) fn run_json(&self, words: &str, option: &str) -> (Run, Value) {
        let _ = fs::remove_file(self.path().join("told.json"));
        let run = self.run_ok(&format!("{words} {option} told.json"));
        (run, self.json("told.json"))
    }

    /// Runs the program, which must refuse in one line that contains all of `says`.
    pub(crate) fn assert_refused(&self, words: &str, says: &[&str]) {
        self.run(words).fails(2, says);
    }

    /// Returns all files, sorted, as relative paths. Manifests and journals of runs are excluded.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let mut files = self.all_files();
        let is_of_run = |name: &OsStr| name.to_string_lossy().starts_with("abvh-run");
        files.retain(|f| !f.file_name().is_some_and(is_of_run));
        files
    }

    /// Returns all files, including manifests and journals.
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

    pub(crate) fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).unwrap()
    }
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
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

    /// Asserts that the run succeeded.
    pub(crate) fn succeeds(self) -> Self {
        self.demand(self.code == Some(0), "should succeed");
        self
    }

    /// Asserts that the run succeeded, and parses its standard output as JSON.
    pub(crate) fn parsed(self) -> Value {
        serde_json::from_str(&self.succeeds().stdout).unwrap()
    }

    /// Asserts that the run ended with `code` and one line on standard error that contains all of `says`.
    pub(crate) fn fails(self, code: i32, says: &[&str]) {
        self.demand(self.code == Some(code), &format!("should exit {code}"));
        let one = self.stderr.lines().count() == 1;
        self.demand(one, "should say one line");
        let begins = self.stderr.starts_with("abvh: ");
        self.demand(begins, "should start with `abvh: `");
        for word in says {
            let said = self.stderr.contains(word);
            self.demand(said, &format!("should say `{word}`"));
        }
    }

    fn demand(&self, holds: bool, what: &str) {
        let told = format!("stderr: {}\nstdout: {}", self.stderr, self.stdout);
        let (words, code) = (&self.words, self.code);
        assert!(holds, "abvh {words}\n{what}\nexit {code:?}\n{told}");
    }
}

/// Returns the elements of a list.
pub(crate) fn list(json: &Value) -> &[Value] {
    json.as_array().unwrap_or_else(|| panic!("no list: {json}"))
}

/// Asserts that the text contains all of `parts`, which are separated by bars.
pub(crate) fn assert_contains(text: &str, parts: &str) {
    for part in parts.split('|') {
        assert!(text.contains(part), "no {part} in {text}");
    }
}

/// A square of two triangles, as OBJ.
pub(crate) const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

/// Creates a test whose body gets a new sandbox.
pub(crate) fn trial(
    name: &str,
    body: impl FnOnce(&Sandbox) + Send + 'static,
) -> libtest_mimic::Trial {
    integration::trial(name, move || body(&Sandbox::new()))
}
