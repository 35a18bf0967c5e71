//! The four files, and the command that measures a point again.

use crate::args::ChartArgs;
use crate::bench::Row;
use crate::stop::Stop;
use crate::values::Frames;
use chart::Chart;
use std::path::{Path, PathBuf};

/// Writes all of them, or as many as can be.
pub(super) fn write(dir: &Path, chart: &Chart) -> Result<Vec<PathBuf>, Stop> {
    write_texts(
        dir,
        [
            ("chart.svg", chart::svg(chart)),
            ("chart.html", chart::html(chart)),
            ("points.csv", chart::csv(chart)),
            ("points.json", chart::json(chart)),
        ],
    )
}

/// Writes files into a folder, up to the first that cannot be written; links there are replaced.
pub(crate) fn write_texts<const N: usize>(
    dir: &Path,
    texts: [(&str, chart::Result<String>); N],
) -> Result<Vec<PathBuf>, Stop> {
    let mut written = Vec::new();
    for (name, text) in texts {
        let path = dir.join(name);
        let text = text.map_err(Stop::failed)?;
        output::remove_link(&path)?;
        output::write_whole(&path, text.as_bytes())?;
        written.push(path);
    }
    Ok(written)
}

/// What measures a point's times again.
pub(super) fn command(args: &ChartArgs, spec: &str, row: &Row) -> String {
    let [width, height] = args.size.size;
    let frames = match &args.frames {
        Frames::Count(n) => n.to_string(),
        Frames::Keys(keys) => {
            let keys: Vec<String> = keys.iter().map(usize::to_string).collect();
            // One alone would be a count.
            format!("{},", keys.join(","))
        }
    };
    let source = source(args);
    format!(
        "abvh bench {}{source} --backend {} --update {} --intersector {} --layout {} --size {width}x{height} --frames {frames}{}",
        quoted(spec),
        row.backend,
        row.update,
        row.intersector,
        row.layout,
        args.warm_up.words(),
    )
}

/// How the scene was read, where that was asked for.
fn source(args: &ChartArgs) -> String {
    let clip = args.source.clip.as_deref();
    let clip = clip.map_or(String::new(), |c| format!(" --clip {}", quoted(c)));
    let plain = (args.source.fps - 24.0).abs() == 0.0;
    let fps = if plain {
        String::new()
    } else {
        format!(" --fps {}", args.source.fps)
    };
    fps + &clip
}

/// As a shell takes it for one word.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./:,=+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_every_word_as_one() {
        assert_eq!(quoted("demo:grove:50"), "demo:grove:50");
        assert_eq!(quoted("my scene/*.obj"), "'my scene/*.obj'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
        assert_eq!(quoted(""), "''");
    }
}
