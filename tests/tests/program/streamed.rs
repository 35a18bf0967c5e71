//! Scenes whose key frames are read while they are played.

use crate::sandbox::{Run, SQUARE, Sandbox, picture, trial};
use libtest_mimic::Trial;
use std::io::Read;
use std::path::PathBuf;

pub(crate) fn trials() -> Vec<Trial> {
    vec![trial(
        "streamed::a_file_that_vanishes_or_shrinks_ends_the_run",
        vanishes,
    )]
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
        let all = format!("{words} --out out{i} --y4m -");
        let mut run = sandbox.piped(&all);
        let reader = run.stdout.as_mut().unwrap();
        reader.read_exact(&mut [0; 1000]).unwrap();
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
    let all = sandbox.files().into_iter();
    let all = all.filter(|f| f.starts_with(format!("out{run}")));
    let whole = |f: &PathBuf| drop(picture(&sandbox.read(&f.to_string_lossy())));
    all.inspect(whole).count()
}
