//! Words and numbers as a person reads them.

/// What XML cannot hold, or would not show on one line, becomes a replacement character or a space.
pub(crate) fn clean(text: &str) -> String {
    let kept = |c: char| match c {
        '\t' | '\n' | '\r' => ' ',
        c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
        c => c,
    };
    text.chars().map(kept).collect()
}

/// The text with the characters that mean something to XML and HTML written as references.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in clean(text).chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// About how wide a text is, in the unit of `size`. Rather too wide: it is measured at a broad font.
pub(crate) fn width(text: &str, size: i32) -> i32 {
    let ems: f64 = text.chars().map(ems).sum();
    (ems * f64::from(size)).ceil() as i32
}

fn ems(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | ' ' | '\u{a0}' => 0.34,
        'f' | 'r' | 't' | '-' | '(' | ')' | '/' | '"' => 0.42,
        'm' | 'w' | 'M' | 'W' | '@' | '%' | '–' | '…' | '×' => 0.98,
        'A'..='Z' => 0.72,
        c if c.is_ascii() => 0.63,
        '⁰'..='⁹' | '¹' | '²' | '³' | '⁻' => 0.45,
        _ => 1.0,
    }
}

/// The text, or as much of it as is at most `room` wide with an ellipsis.
pub(crate) fn fit(text: &str, size: i32, room: i32) -> String {
    let text = clean(text);
    if width(&text, size) <= room {
        return text;
    }
    let mut short = text;
    while !short.is_empty() && width(&short, size) + size > room {
        short.pop();
    }
    short.trim_end().to_owned() + "…"
}

/// A whole number with its digits in groups of three.
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let first = (digits.len() - 1) % 3 + 1;
    let (head, tail) = digits.split_at(first);
    let mut out = head.to_owned();
    for i in (0..tail.len()).step_by(3) {
        out.push('\u{a0}');
        out.push_str(&tail[i..i + 3]);
    }
    out
}

/// A whole number in about three digits: `2.30 M`.
pub(crate) fn short_count(n: u64) -> String {
    let units = [(1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")];
    match units.iter().find(|u| n as f64 >= u.0) {
        Some((unit, name)) => format!("{}\u{a0}{name}", number(n as f64 / unit)),
        None => n.to_string(),
    }
}

/// Three significant digits; as a power of ten where plain digits would be many.
pub(crate) fn number(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    // Rounding to three digits may raise the exponent: 9.999 is 10.0.
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    let exponent = rounded.abs().log10().floor();
    if !(-4.0..6.0).contains(&exponent) {
        let text = format!("{x:.2e}");
        return match text.split_once('e') {
            Some((mantissa, power)) => format!("{mantissa}×10{}", superscript(power)),
            None => text,
        };
    }
    let decimals = (2.0 - exponent).max(0.0) as usize;
    format!("{x:.decimals$}")
}

/// Digits and minus raised.
pub(crate) fn superscript(text: &str) -> String {
    let raise = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => c
            .to_digit(10)
            .map_or(c, |d| char::from_u32(0x2070 + d).unwrap_or(c)),
    };
    text.chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0, "0"),
            (9.999, "10.0"),
            (0.012_345, "0.0123"),
            (123_456.0, "123456"),
            (1.5e-9, "1.50×10⁻⁹"),
            (4.2e12, "4.20×10¹²"),
            (5e-324, "4.94×10⁻³²⁴"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
        assert_eq!(number(f64::NAN), "NaN");
    }

    #[test]
    fn counts_are_grouped_and_shortened() {
        assert_eq!(count(0), "0");
        assert_eq!(count(1_234_567).replace('\u{a0}', " "), "1 234 567");
        assert_eq!(count(123), "123");
        assert_eq!(short_count(999), "999");
        assert_eq!(short_count(2_304_000).replace('\u{a0}', " "), "2.30 M");
    }

    #[test]
    fn nothing_in_a_name_is_markup() {
        assert_eq!(escape("<&>\"'\u{1}\n"), "&lt;&amp;&gt;&quot;&#39;\u{fffd} ");
    }

    #[test]
    fn long_names_are_cut_to_their_room() {
        let text = fit(&"wide ".repeat(40), 16, 200);
        assert!(width(&text, 16) <= 200 && text.ends_with('…'));
        assert_eq!(fit("short", 16, 200), "short");
        assert_eq!(fit("anything", 16, 0), "…");
    }
}
