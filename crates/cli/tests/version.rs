//! Tests the program's version. Tests of other crates run the program. They make cargo build this test, because cargo
//! then also builds the program.

use std::process::Command;

#[test]
fn prints_the_package_version() {
    let output = Command::new(env!("CARGO_BIN_EXE_abvh"))
        .arg("--version")
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text, concat!("abvh ", env!("CARGO_PKG_VERSION"), "\n"));
}
