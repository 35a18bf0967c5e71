//! Tests of the documentation: links have targets, and the README has its two commands.

use crate::sandbox::trial;
use integration::scenes::workspace;
use libtest_mimic::Trial;
use std::fs;
use std::path::{Path, PathBuf};

pub(crate) fn trials() -> Vec<Trial> {
    vec![
        trial("pages::every_link_has_a_target", |_| links_lead()),
        trial("pages::readme_has_two_commands", |_| two_commands()),
    ]
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Collects all pages of the repository, except in hidden folders and build output.
fn pages(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("folders can be read") {
        let path = entry.expect("folders can be read").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && !name.starts_with('.') && name != "target" {
            pages(&path, found);
        } else if path.extension().is_some_and(|e| e == "md") {
            found.push(path);
        }
    }
}

/// Returns the lines of a page that are not code.
fn prose(page: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    page.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        !code && !fence
    })
}

/// Returns the link targets of a page within the repository, in order.
fn links(page: &str) -> Vec<&str> {
    let of_line = |line| {
        let after = str::split(line, "](").skip(1);
        after.filter_map(|rest: &str| rest.split_once(')').map(|(link, _)| link))
    };
    let all = prose(page).flat_map(of_line);
    all.filter(|link| !link.contains("://")).collect()
}

/// Converts a heading to its anchor: lower case, blanks as dashes, otherwise only letters, digits, `-` and `_`.
fn anchor(heading: &str) -> String {
    let lower = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = lower.chars().filter_map(|c| match c {
        ' ' => Some('-'),
        c if c.is_alphanumeric() || "-_".contains(c) => Some(c),
        _ => None,
    });
    kept.collect()
}

fn has_anchor(page: &str, name: &str) -> bool {
    let mut headings = prose(page).filter(|line| line.starts_with('#'));
    headings.any(|heading| anchor(heading) == name)
}

/// Returns whether the target of a page's link exists.
fn leads(from: &Path, link: &str) -> bool {
    let (path, place) = link.split_once('#').unwrap_or((link, ""));
    let to = match path {
        "" => from.to_owned(),
        path => from.with_file_name(path),
    };
    to.exists() && (place.is_empty() || has_anchor(&read(&to), place))
}

fn links_lead() {
    let mut found = Vec::new();
    pages(&workspace(), &mut found);
    let mut count = 0;
    let mut dead = Vec::new();
    for page in &found {
        let text = read(page);
        for link in links(&text) {
            count += 1;
            if !leads(page, link) {
                dead.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{dead:#?}");
    assert!(found.len() > 5 && count > 20, "{count} links in {found:?}");
}

/// Checks that the README starts with the two commands that a new user needs.
fn two_commands() {
    let readme = read(&workspace().join("README.md"));
    let lines: Vec<&str> = readme.lines().take(16).collect();
    let command = |words: &str| lines.iter().any(|l| l.split("  ").next() == Some(words));
    let both = command("cargo run --release") && command("cargo test");
    assert!(both, "{lines:#?}");
    assert!(lines.iter().any(|l| l.starts_with("![")), "a picture");
    assert!(readme.lines().count() < 150, "a manual belongs into docs/");
}
