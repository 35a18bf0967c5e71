//! The command that measures a point again.

use crate::args::ChartArgs;
use crate::bench::Row;
use crate::values::Frames;

/// What measures a point's times again.
pub(super) fn of(args: &ChartArgs, spec: &str, row: &Row) -> String {
    let [width, height] = args.size.size;
    let frames = match &args.frames {
        Frames::Count(n) => n.to_string(),
        // One alone would be a count.
        Frames::Keys(keys) => keys.iter().map(|key| format!("{key},")).collect(),
    };
    let mut source = String::new();
    if (args.source.fps - 24.0).abs() > 0.0 {
        source += &format!(" --fps {}", args.source.fps);
    }
    if let Some(clip) = &args.source.clip {
        source += &format!(" --clip {}", quoted(clip));
    }
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

/// As a shell takes it for one word.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./:,=+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
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
