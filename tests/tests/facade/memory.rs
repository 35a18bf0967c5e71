//! Tests of scenes that need more memory than the process may use.

use abvh::{Device, Error, Mesh, Scene, Tracer};
use std::env;
use std::process::{self, Command};

/// Set for the child process that builds such a scene.
const CHILD: &str = "ABVH_TEST_BUILD_A_LARGE_SCENE";

/// Builds the scene and exits if this is the child process.
pub(crate) fn child() {
    if env::var_os(CHILD).is_none() {
        return;
    }
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = Mesh::fixed(&points, &vec![[0, 1, 2]; 4_000_000]).unwrap();
    let mut scene = Scene::new();
    scene.add(mesh);
    let built = Tracer::builder()
        .device(Device::Cpu)
        .threads(2)
        .build(scene);
    let refused = built.and_then(|mut tracer| tracer.warm_up(0.0));
    match refused {
        Err(Error::OutOfMemory(_)) => process::exit(0),
        other => panic!("{other:?}"),
    }
}

/// Checks that a process with little address space gets an error. An unhandled failed allocation would abort it.
pub(crate) fn refused(_: &Device) {
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -v 700000 && exec \"$0\""]);
    let program = shell.arg(env::current_exe().unwrap()).env(CHILD, "1");
    let ended = program.output().unwrap();
    assert!(ended.status.success(), "{ended:?}");
}
