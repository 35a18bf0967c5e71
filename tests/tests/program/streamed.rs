//! Scenes whose key frames are read while they are played.

use crate::runs::bytes;
use crate::sandbox::{Run, SQUARE, Sandbox, trial};
use libtest_mimic::Trial;
use std::io::Read;
use std::process::{Command, Stdio};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial(
            "streamed::hits_are_those_of_key_frames_that_are_held",
            same_hits,
        ),
        trial(
            "streamed::a_file_that_vanishes_or_shrinks_ends_the_run",
            vanishes,
        ),
    ]
}

fn same_hits(sandbox: &Sandbox) {
    let render = |scene: &str, out: &str, more: &str| {
        let words = format!(
            "render {scene} --time-range 0.3..20 --frames 30 --eye 0,1.5,4 --look-at 0,1,0 --size 64x48 --no-images --hits {out} --quiet {more}"
        );
        sandbox.does(&words);
        bytes(sandbox, out)
    };
    for (i, backend) in ["cpu", "vulkan"].into_iter().enumerate() {
        let scene = "demo:twist:2000+demo:twist:300@0,2,0*0.5";
        let method = format!("--backend {backend} --update async --lockstep 2");
        let held = render(scene, &format!("held{i}"), &method);
        let streamed = render(
            scene,
            &format!("few{i}"),
            &format!("{method} --key-memory 0"),
        );
        assert!(held == streamed, "{backend}: other hits");
    }
}

const FILES: usize = 200;

fn write(sandbox: &Sandbox, key: usize) {
    let text = SQUARE.replace("v 0 0 0", &format!("v {} 0 0", key as f32 * 1e-3));
    sandbox.write(&format!("keys/{key}.obj"), text);
}

/// A reader that takes nothing keeps the run from reading all files before one of them is gone.
fn vanishes(sandbox: &Sandbox) {
    (0..FILES).for_each(|key| write(sandbox, key));
    let words = "render keys --key-memory 0 --backend cpu --frames 0..200 --size 320x240 --quiet";
    for (i, says) in [
        "keys/199.obj: no such file",
        "keys/199.obj: the file was changed",
    ]
    .into_iter()
    .enumerate()
    {
        let mut command = Command::new(integration::program::abvh());
        let all = format!("{words} --out out{i} --y4m -");
        command.args(all.split(' ')).current_dir(sandbox.path());
        let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut run = piped.spawn().unwrap();
        run.stdout
            .as_mut()
            .unwrap()
            .read_exact(&mut [0; 1000])
            .unwrap();
        match i {
            0 => sandbox.remove("keys/199.obj"),
            _ => sandbox.write("keys/199.obj", "v 0 0"),
        }
        let mut output = run.wait_with_output().unwrap();
        output.stdout.clear();
        Run::of(&output, &all).fails(1, &[says]);
        let done = pictures(sandbox, i);
        assert!((1..FILES).contains(&done), "{done} pictures");
        write(sandbox, 199);
        sandbox.does(&format!("{words} --out out{i} --resume"));
        assert_eq!(pictures(sandbox, i), FILES);
    }
}

/// How many there are, all of them whole.
fn pictures(sandbox: &Sandbox, run: usize) -> usize {
    let folder = sandbox.path().join(format!("out{run}"));
    let all = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path());
    let all: Vec<_> = all
        .filter(|p| p.extension().is_some_and(|e| e == "png"))
        .collect();
    for file in &all {
        image::open(file).unwrap();
    }
    all.len()
}
