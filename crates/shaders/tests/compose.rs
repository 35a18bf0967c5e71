//! Tests how the build script composes kernels: imports, conditions, unused declarations, names and errors.

#[path = "../build/compose.rs"]
mod compose;
#[path = "../build/syntax.rs"]
mod syntax;

use anyhow::Result;
use compose::{Files, Sources};

/// Conditions that the files may use.
const CONDITIONS: [&str; 3] = ["A", "B", "C"];

/// Composes `main` of the file `k/main`, with these conditions and this prefix.
fn compose_with(files: &[(&str, &str)], prefix: &str, on: &[&str]) -> Result<String> {
    let files = files
        .iter()
        .map(|(path, text)| (path.to_string(), text.to_string()));
    let files: Files = files.collect();
    let conditions = CONDITIONS.map(str::to_owned).into();
    Sources::new(&files, conditions)?.compose("k/main", &["main"], prefix, on)
}

/// Composes one file.
fn compose_file(main: &str, on: &[&str]) -> String {
    compose_with(&[("k/main", main)], "", on).unwrap()
}

#[track_caller]
fn assert_error(files: &[(&str, &str)], expected: &str) {
    let error = compose_with(files, "", &[]).expect_err(expected);
    assert_eq!(error.to_string(), expected);
}

#[test]
fn unused_declarations_and_comments_are_removed() {
    let main = "// Comment {\nfn other() { unused(); }\nconst X: u32 = 1u; // Comment\n\nfn main() {\n    // Comment\n    \
                let y = X;\n}\nfn unused() {}\n";
    let expected = "const X: u32 = 1u;\n\nfn main() {\n    let y = X;\n}\n";
    assert_eq!(compose_file(main, &[]), expected);
}

#[test]
fn files_follow_in_order_of_use() {
    let main = "import package::k::b::{b_two, b_one};\nimport package::k::a::Type;\nfn main() { b_two(b_one(), Type()); }";
    let a = "struct Type { x: u32 }";
    let b = "import package::k::a::Type;\nfn b_one() -> u32 { return 1u; }\nfn b_two(x: u32, t: Type) {}";
    let expected = "fn main() { b_two(b_one(), Type()); }\n\nfn b_one() -> u32 { return 1u; }\n\n\
                    fn b_two(x: u32, t: Type) {}\n\nstruct Type { x: u32 }\n";
    let files = [("k/main", main), ("k/a", a), ("k/b", b)];
    assert_eq!(compose_with(&files, "", &[]).unwrap(), expected);
}

#[test]
fn published_imports_are_followed_and_renamed() {
    let main = "import package::k::choice::f;\nfn main() { f(); x.f = 1; }";
    let choice = "@if(A)\n@publish import package::k::impl::{f_a as f};\n@if(!A)\n@publish import package::k::impl::f_b as f;";
    let other = "fn f_a() {}\nfn f_b() {}";
    let files = [("k/main", main), ("k/choice", choice), ("k/impl", other)];
    let expected = |name| format!("fn main() {{ {name}(); x.f = 1; }}\n\nfn {name}() {{}}\n");
    assert_eq!(compose_with(&files, "", &["A"]).unwrap(), expected("f_a"));
    assert_eq!(compose_with(&files, "", &["B"]).unwrap(), expected("f_b"));
}

#[test]
fn conditions_select_declarations() {
    let main = "@if(A)\nconst X = 1;\n@elif(B)\nconst X = 2;\n@else\nconst X = 3;\nfn main() { let y = X; }";
    for (on, x) in [(&["A", "B"][..], 1), (&["B"], 2), (&["C"], 3)] {
        let expected = format!("const X = {x};\n\nfn main() {{ let y = X; }}\n");
        assert_eq!(compose_file(main, on), expected, "{on:?}");
    }
}

#[test]
fn conditions_combine_by_operators() {
    let holds = |condition: &str, on: &[&str]| {
        let main = format!("fn main() {{ @if({condition}) call(); }}");
        compose_file(&main, on).contains("call")
    };
    assert!(holds("!A", &["B"]) && !holds("!A", &["A"]));
    assert!(holds("A || B || C", &["C"]) && !holds("A || B", &["C"]));
    assert!(holds("A && B && C", &["A", "B", "C"]) && !holds("A && B", &["B"]));
    assert!(holds("A && !(B || C)", &["A"]) && !holds("A && !(B || C)", &["A", "C"]));
    assert!(holds("(A && B) || C", &["C"]) && !holds("A && (B || C)", &["C"]));
}

#[test]
fn conditions_select_statements_members_and_parameters() {
    let main = "struct S {
    @if(A) @align(16) a: array<vec2<u32>, 4>,
    b: u32,
    @if(!A) c: u32
}
fn main(s: S, @if(A) a: ptr<function, u32>) {
    @if(A)
    if a < 1 { return; } else if a > 2 { f(x, y); } else { g(); }
    @else
    for (var i = 0; i < 2; i += 1) { @if(B) break; @else continue; }
    @if(B) { let x = 1; }
    h();
}
";
    let with = "struct S {
    @align(16) a: array<vec2<u32>, 4>,
    b: u32,
}

fn main(s: S, a: ptr<function, u32>) {
    if a < 1 { return; } else if a > 2 { f(x, y); } else { g(); }
    h();
}
";
    let without = "struct S {
    b: u32,
    c: u32
}

fn main(s: S,) {
    for (var i = 0; i < 2; i += 1) { break; }
    { let x = 1; }
    h();
}
";
    assert_eq!(compose_file(main, &["A"]), with);
    assert_eq!(compose_file(main, &["B"]), without);
}

#[test]
fn prefix_is_added_to_names_of_declarations_only() {
    let main = "import package::k::a::{S, count as n};
fn helper(s: S) -> u32 { return s.count + n; }
fn main() { let x = helper(S()); }
";
    let a = "struct S { count: u32 }\nconst count: u32 = 2u;";
    let expected = "fn p_helper(s: p_S) -> u32 { return s.count + p_count; }

fn main() { let x = p_helper(p_S()); }

struct p_S { count: u32 }

const p_count: u32 = 2u;
";
    let made = compose_with(&[("k/main", main), ("k/a", a)], "p_", &[]);
    assert_eq!(made.unwrap(), expected);
}

#[test]
fn bindings_are_numbered_in_order() {
    let main = "@group(0) @binding(next) var<uniform> unused: u32;
@group(0) @binding(next) var<uniform> x: u32;
@group(0) @binding(next) var<storage, read> y: u32;
fn main() { f(y, x); }";
    let made = compose_file(main, &[]);
    assert!(made.starts_with("@group(0) @binding(1) var<uniform> x: u32;\n"));
    assert!(made.contains("@group(0) @binding(2) var<storage, read> y: u32;\n"));
}

#[test]
fn invalid_imports_are_errors() {
    let main = ("k/main", "\nimport package::k::a::f;\nfn main() { f(); }");
    let missing = "wgsl/k/main.wgsl:2: wgsl/k/a.wgsl has no `f`";
    assert_error(&[main], missing);
    assert_error(&[main, ("k/a", "fn g() {}")], missing);
    let private = ("k/a", "import package::k::b::f;\nfn g() { f(); }");
    assert_error(&[main, private, ("k/b", "fn f() {}")], missing);
    let conditional = ("k/a", "@if(A) fn f() {}");
    assert_error(&[main, conditional], &format!("{missing} under "));
    let unused = (
        "k/main",
        "import package::k::a::{\n    f,\n    g,\n};\nfn main() { f(); }",
    );
    let a = ("k/a", "fn f() {}\nfn g() {}");
    assert_error(&[unused, a], "wgsl/k/main.wgsl:3: unused import `g`");
}

#[test]
fn invalid_files_are_errors() {
    let unknown = "2: unknown condition `D`";
    let invalid = "2: invalid condition";
    let hidden = "3: local name `x` hides a declaration";
    for (main, expected) in [
        ("fn main() {\n@if(D) f();\n}", unknown),
        ("fn main() {\n@if(A || D) f();\n}", unknown),
        ("fn main() {\n@if(A) { @if(D) f(); }\n}", unknown),
        ("fn main() {\n@if(A || B && C) f();\n}", invalid),
        ("fn main() {\n@if(A B) f();\n}", invalid),
        (
            "fn main() {\n@if(A) f(); g(); @else h();\n}",
            "2: `@else` does not follow `@if`",
        ),
        (
            "fn main() {\n@if(A) f(); @else g(); @elif(B) h();\n}",
            "2: `@elif` does not follow `@if`",
        ),
        ("fn main() {\n    f(];\n}", "2: unbalanced `]`"),
        ("fn main() {}\n}", "2: unbalanced `}`"),
        ("\nfn main() {", "2: no `}` closes the bracket"),
        ("fn main() { return a<b; }", "1: unbalanced `}`"),
        (
            "fn main() {}\n@if(!A) fn main() {}",
            "2: `main` is declared twice",
        ),
        ("const x = 1;\nfn main(\n    x: u32) {}", hidden),
        ("const x = 1;\nfn main() {\n    let x = 1; }", hidden),
        (
            "fn main() {}\nfunction f() {}",
            "2: `function` begins no declaration",
        ),
        (
            "import a::f;\nfn main() { f(); }",
            "1: `import` begins no declaration",
        ),
    ] {
        assert_error(&[("k/main", main)], &format!("wgsl/k/main.wgsl:{expected}"));
    }
    assert_error(&[("k/main", "fn f() {}")], "wgsl/k/main.wgsl has no `main`");
}
