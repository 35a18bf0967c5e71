//! Pipes and devices in the place of files.
#![cfg(unix)]

use rustix::fs::{CWD, Mode, mkfifoat};
use scene::{Options, open};
use std::fs;
use std::os::unix::fs::symlink;

#[test]
fn key_frames_that_are_pipes_or_devices_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let below = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let message = |path: &str| open(path, &Options::default()).unwrap_err().to_string();
    fs::write(below("1.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    mkfifoat(CWD, below("2.obj"), Mode::RUSR).unwrap();
    for path in ["", "*.obj", "2.obj"] {
        let message = message(&below(path));
        assert!(message.contains("2.obj: cannot read: a pipe"), "{message}");
    }
    for kind in ["ply", "gltf", "obj"] {
        let link = below(&format!("zeros.{kind}"));
        symlink("/dev/zero", &link).unwrap();
        let message = message(&link);
        assert!(message.contains("a device is not"), "{message}");
    }
}
