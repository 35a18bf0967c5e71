//! Tests of scenes that need more memory than the process may use.

use abvh::{Device, Error, Mesh, Scene, Tracer};
use std::env;
use std::process::{self, Command};

/// Environment variable of the child process that builds such a scene. Its value is one of [`KINDS`].
const CHILD: &str = "ABVH_TEST_BUILD_A_LARGE_SCENE";
const KINDS: [&str; 2] = ["triangles", "key frames"];

/// Returns one mesh of many triangles, or a mesh of many vertices and another of many key frames.
fn meshes(kind: &str) -> Vec<Mesh> {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let meshes = if kind == KINDS[0] {
        vec![Mesh::fixed(&points, &vec![[0, 1, 2]; 4_000_000])]
    } else {
        vec![
            Mesh::fixed(&vec![[0.0; 3]; 100_000], &[]),
            Mesh::keyframes(vec![points.to_vec(); 1000], &[[0, 1, 2]]),
        ]
    };
    meshes.into_iter().map(Result::unwrap).collect()
}

/// Builds the scene and exits if this is the child process.
pub(crate) fn child() {
    let Ok(kind) = env::var(CHILD) else {
        return;
    };
    let mut scene = Scene::new();
    for mesh in meshes(&kind) {
        scene.add(mesh);
    }
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
pub(crate) fn scene_beyond_memory_is_refused(_: &Device) {
    for kind in KINDS {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -v 700000 && exec \"$0\""]);
        let program = shell.arg(env::current_exe().unwrap()).env(CHILD, kind);
        let ended = program.output().unwrap();
        assert!(ended.status.success(), "{kind}: {ended:?}");
    }
}
