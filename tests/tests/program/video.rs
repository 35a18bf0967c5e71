//! `--video` and `--y4m`: frames are in order, and errors leave no file.

use crate::sandbox::{Sandbox, trial};
use libtest_mimic::Trial;
use std::ffi::OsStr;
#[cfg(unix)]
use std::{fs, process::Command, thread};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("video::raw_video_matches_pictures", raw),
        trial("video::missing_encoder_is_refused", absent),
        #[cfg(unix)]
        trial("video::encoder_receives_frames_in_order", encoded),
        #[cfg(unix)]
        trial("video::failed_encoder_leaves_no_video", fails),
        #[cfg(unix)]
        trial(
            "video::signal_sets_exit_code_though_encoder_fails",
            interrupted,
        ),
    ]
}

const RUN: &str = "render demo:twist:500 --frames 5 --size 32x18 --quiet";

/// Returns the pixels of all pictures of the run.
fn pictures(sandbox: &Sandbox) -> Vec<u8> {
    let picture = |i| image::open(sandbox.path().join(format!("out/frame_{i:04}.png"))).unwrap();
    (0..5)
        .flat_map(|i| picture(i).into_rgb8().into_raw())
        .collect()
}

fn raw(sandbox: &Sandbox) {
    let words = format!("{RUN} --fps 12.5 --out out --y4m a.y4m");
    sandbox.run_ok(&words);
    let file = sandbox.read("a.y4m");
    let mut decoder = y4m::decode(&file[..]).unwrap();
    let size = [decoder.get_width(), decoder.get_height()];
    let rate = decoder.get_framerate();
    assert_eq!((size, rate.num, rate.den), ([32, 18], 12_500, 1000));
    let pictures = pictures(sandbox);
    for picture in pictures.chunks(32 * 18 * 3) {
        let frame = decoder.read_frame().unwrap();
        for (rgb, &luma) in picture.chunks(3).zip(frame.get_y_plane()) {
            // BT.601, limited range.
            let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(f64::from);
            let expected = 16.0 + (65.481 * r + 128.553 * g + 24.966 * b) / 255.0;
            assert!((expected - f64::from(luma)).abs() < 0.6, "{rgb:?} {luma}");
        }
    }
    assert!(decoder.read_frame().is_err());
    // The video may be in an output folder that the run creates.
    sandbox.run_ok(&format!(
        "{RUN} --fps 12.5 --out new/deep --y4m new/deep/a.y4m"
    ));
    assert!(sandbox.read("new/deep/a.y4m") == file);
    // `--y4m -` writes the video to standard output, and messages to standard error.
    let words = format!("{RUN} --no-images --fps 12.5 --y4m -");
    let output = integration::program::run_where(sandbox.path(), words.split(' '), &[]);
    assert!(output.status.success());
    assert_eq!(output.stdout, file);
    #[cfg(unix)]
    piped(sandbox, &file);
}

/// Checks that output to a pipe or a link does not replace it.
#[cfg(unix)]
fn piped(sandbox: &Sandbox, file: &[u8]) {
    use std::os::unix::fs::FileTypeExt;
    let [pipe, link] = ["pipe", "link"].map(|name| sandbox.path().join(name));
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    std::os::unix::fs::symlink("a.y4m", &link).unwrap();
    for (name, holds) in [
        ("--fps 12.5 --y4m pipe", file),
        ("--fps 12.5 --y4m link", file),
        ("--stats pipe", b"{"),
    ] {
        let reader = name.ends_with("pipe").then(|| {
            let pipe = pipe.clone();
            thread::spawn(move || fs::read(pipe).unwrap())
        });
        sandbox.run_ok(&format!("{RUN} --no-images {name}"));
        assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
        let read = reader.map(|reader| reader.join().unwrap());
        assert!(read.is_none_or(|read| read.starts_with(holds)), "{name}");
    }
    assert!(link.is_symlink() && sandbox.read("a.y4m") == file);
}

fn absent(sandbox: &Sandbox) {
    let words = format!("{RUN} --out out --video a.mp4");
    let run = sandbox.run_where(&words, &[("PATH", OsStr::new("/nowhere"))]);
    run.fails(2, &["ffmpeg", "--y4m"]);
    assert!(sandbox.all_files().is_empty());
    sandbox.assert_refused(&format!("{RUN} --video a.gif"), &["a.gif", ".mp4"]);
    let twice = format!("{RUN} --video a.mp4 --y4m a.mp4");
    sandbox.assert_refused(&twice, &["would overwrite"]);
}

/// Installs a script as `ffmpeg`. Returns the `PATH` to use.
#[cfg(unix)]
pub(crate) fn encoder(sandbox: &Sandbox, script: &str) -> std::ffi::OsString {
    use std::os::unix::fs::PermissionsExt;
    let script = format!("#!/bin/sh\nfor last; do :; done\n{script}\n");
    sandbox.write("bin/ffmpeg", script);
    let file = sandbox.path().join("bin/ffmpeg");
    std::fs::set_permissions(file, PermissionsExt::from_mode(0o755)).unwrap();
    let mut path = sandbox.path().join("bin").into_os_string();
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    path
}

#[cfg(unix)]
fn encoded(sandbox: &Sandbox) {
    let path = encoder(sandbox, "cat > \"$last\"");
    let encoded = |options: &str| {
        let words = format!("{RUN} {options} --video a.mp4");
        sandbox.run_where(&words, &[("PATH", &path)]).succeeds();
        sandbox.read("a.mp4")
    };
    sandbox.run_ok(&format!("{RUN} --out out --y4m a.y4m"));
    let video = encoded("--no-images");
    assert_eq!(video, sandbox.read("a.y4m"));
    for threads in [1, 4] {
        let afresh = format!("--out out --overwrite --threads {threads}");
        assert!(encoded(&afresh) == video, "{threads}");
        // A finished run encodes all of its frames again.
        sandbox.remove("a.mp4");
        assert!(encoded("--out out --resume") == video, "{threads}");
    }
}

#[cfg(unix)]
fn fails(sandbox: &Sandbox) {
    const EARLY: &str = "ffmpeg ended early: no codec";
    for (script, says) in [
        ("head -c 2000 > \"$last\"; echo no codec >&2; exit 3", EARLY),
        ("exec <&-; echo no codec >&2; exit 1", EARLY),
        ("cat", "ffmpeg wrote no video"),
        ("cat; rm \"$last\"", "ffmpeg wrote no video"),
    ] {
        let path = encoder(sandbox, script);
        let words = format!("{RUN} --no-images --video a.webm");
        let run = sandbox.run_where(&words, &[("PATH", &path)]);
        run.fails(1, &[says]);
        assert!(sandbox.files().iter().all(|file| file.starts_with("bin")));
    }
}

/// Interrupts the run after the last frame. The encoder then fails, as after Ctrl-C on a terminal.
#[cfg(unix)]
fn interrupted(sandbox: &Sandbox) {
    // The encoder fails before the grace period ends the run, one second after the signal.
    let script = "cat > \"$last\"; kill -INT $PPID; sleep 0.3; exit 255";
    let path = encoder(sandbox, script);
    let words = format!("{RUN} --no-images --video a.webm");
    let run = sandbox.run_where(&words, &[("PATH", &path)]);
    assert_eq!(run.code, Some(130), "{}", run.stderr);
    assert!(sandbox.files().iter().all(|file| file.starts_with("bin")));
}
