//! Parsing of text from other programs: all kinds of line ends, non-finite numbers, and a check of the encoding.

use std::str::FromStr;

/// Splits `bytes` into lines that end in LF, CR or CR LF. The last line may lack a line end. A final line end does
/// not start an empty line.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split_inclusive(|b| *b == b'\n').flat_map(|line| {
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        line.split(|b| *b == b'\r')
    })
}

/// Parses a number. Accepts C library spellings of `nan` and `inf`: `-nan(ind)`, `1.#QNAN`, `-1.#INF00`.
pub(crate) fn number<F: FromStr>(word: &str) -> Option<F> {
    let parsed = word.parse().ok();
    parsed.or_else(|| not_finite(word)?.parse().ok())
}

fn not_finite(word: &str) -> Option<&'static str> {
    let bare = word.strip_prefix(['-', '+']).unwrap_or(word);
    if let Some(name) = bare.strip_prefix("1.#") {
        return match name.strip_prefix("INF") {
            _ if !is_msvc_name(name) => None,
            Some(_) if word.starts_with('-') => Some("-inf"),
            Some(_) => Some("inf"),
            None => Some("nan"),
        };
    }
    let head = bare.get(..4)?;
    (head.eq_ignore_ascii_case("nan(") && bare.ends_with(')')).then_some("nan")
}

/// Returns whether `name` can follow `1.#` in Visual C++ output. Its `printf` pads names with zeros and exponents, or
/// truncates them to the requested precision.
fn is_msvc_name(name: &str) -> bool {
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit() || "e+-".contains(c));
    !letters.is_empty() && letters.bytes().all(|b| b.is_ascii_uppercase())
}

/// Returns `line` without its comment. The `#` in a number such as `1.#IND` does not start a comment.
pub(crate) fn before_comment(line: &str) -> &str {
    let starts_comment = |&(at, _): &(usize, &str)| {
        let (before, after) = (&line[..at], &line[at + 1..]);
        let end = after.find(|c: char| c.is_ascii_whitespace() || c == '#');
        let name = &after[..end.unwrap_or(after.len())];
        let is_number = before.ends_with("1.") && is_msvc_name(name);
        !is_number
    };
    let comment = line.match_indices('#').find(starts_comment);
    comment.map_or(line, |(at, _)| &line[..at])
}

/// Refuses UTF-16 and UTF-32 text, whose words the readers would not recognize.
pub(crate) fn check_encoding(bytes: &[u8]) -> Result<(), String> {
    let name = match bytes {
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => "UTF-32",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "UTF-16",
        [1..=255, 0, 0, 0, ..] | [0, 0, 0, 1..=255, ..] => "UTF-32",
        [1..=255, 0, 1..=255, 0, ..] | [0, 1..=255, 0, 1..=255, ..] => "UTF-16",
        _ => return Ok(()),
    };
    Err(format!("the text is {name}; save it as UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_all_line_endings() {
        let split = |text: &'static str| -> Vec<_> { lines(text.as_bytes()).collect() };
        assert_eq!(split("a\nb\rc\r\nd"), [b"a", b"b", b"c", b"d"]);
        assert_eq!(split("a\r\r\n\nb\r"), [&b"a"[..], b"", b"", b"b"]);
        assert!(split("").is_empty());
    }

    #[test]
    fn parses_c_spellings_of_non_finites() {
        for word in [
            "nan",
            "NaN",
            "-nan",
            "-nan(ind)",
            "nan(snan)",
            "NAN(0x8)",
            "1.#IND",
            "-1.#IND00",
            "1.#QNAN",
            "+1.#SNAN",
            "1.#R",
            "-1.#IO",
            "1.#QNAN0e+000",
        ] {
            assert!(number::<f32>(word).is_some_and(f32::is_nan), "{word}");
        }
        for (word, value) in [("1.#INF", f32::INFINITY), ("-1.#INF00", -f32::INFINITY)] {
            assert_eq!(number::<f32>(word), Some(value), "{word}");
        }
        for word in [
            "1.#", "1.#5", "1.#inf", "2.#INF", "nan(", "nan()x", "1.0.0", "", "#",
        ] {
            assert_eq!(number::<f32>(word), None, "{word}");
        }
    }

    #[test]
    fn comment_starts_outside_numbers() {
        for (line, before) in [
            ("v 1 2 3 # x", "v 1 2 3 "),
            ("v 1 2 3# x", "v 1 2 3"),
            (
                "v -1.#IND 1.#QNAN 1.#INF # 1.#IND",
                "v -1.#IND 1.#QNAN 1.#INF ",
            ),
            ("v 0 0 1.#IND# x", "v 0 0 1.#IND"),
            ("v 0 0 1.# x", "v 0 0 1."),
            ("v 0 0 1.#x", "v 0 0 1."),
            ("# \u{e9}\\", ""),
            ("v 1 2 3", "v 1 2 3"),
        ] {
            assert_eq!(before_comment(line), before);
        }
    }

    #[test]
    fn rejects_utf16_and_utf32() {
        let wide = |bytes: usize, big: bool, text: &str| -> Vec<u8> {
            let unit = |c: char| {
                let all = (c as u32).to_be_bytes();
                let mut unit = all[4 - bytes..].to_vec();
                if !big {
                    unit.reverse();
                }
                unit
            };
            text.chars().flat_map(unit).collect()
        };
        for text in ["\u{feff}v 0 0 0\n", "v 0 0 0\n", "# \u{4e2d}"] {
            for big in [false, true] {
                for (bytes, name) in [(2, "UTF-16"), (4, "UTF-32")] {
                    let refused = check_encoding(&wide(bytes, big, text)).unwrap_err();
                    assert!(refused.contains(name), "{text:?} {big}: {refused}");
                }
            }
            assert_eq!(check_encoding(text.as_bytes()), Ok(()));
        }
    }
}
