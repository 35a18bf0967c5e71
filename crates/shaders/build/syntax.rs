//! The subset of WESL in which kernels are written: WGSL with imports and conditions.
//!
//! `import package::folder::file::{a, b as c};` imports declarations. With `@publish`, other files can import them from here.
//! `@if(A && !(B || C))`, `@elif(D)` and `@else` precede an import, a declaration, a statement, a member or a parameter.
//! Comments begin with `//`. Only the `<` of a template follows a word without a space.
//!
//! Errors begin with a line number.

use anyhow::{Context, Result, bail, ensure};
use std::collections::BTreeSet;

#[derive(Clone, Copy)]
pub(crate) struct Token<'a> {
    pub(crate) text: &'a str,
    /// White space before the token in its line.
    pub(crate) gap: &'a str,
    pub(crate) line: usize,
    /// Number of pairs of brackets around the token. Brackets are outside their own pair.
    pub(crate) depth: usize,
}

/// A top-level declaration, or one name of an import statement.
pub(crate) struct Item<'a> {
    pub(crate) name: &'a str,
    pub(crate) line: usize,
    /// Empty for imports.
    pub(crate) tokens: Vec<Token<'a>>,
    pub(crate) import: Option<Import<'a>>,
}

#[derive(Clone)]
pub(crate) struct Import<'a> {
    /// The imported file, such as `lib/params`.
    pub(crate) path: String,
    /// The name in that file.
    pub(crate) original: &'a str,
    /// Whether other files can import the name from the importing file.
    pub(crate) is_published: bool,
}

/// Values of conditions.
pub(crate) struct Conditions<'c> {
    pub(crate) known: &'c BTreeSet<String>,
    /// The conditions that hold. `None` selects all branches, for checks.
    pub(crate) on: Option<&'c [&'c str]>,
}

/// Returns whether the text is an identifier, a keyword or a number.
pub(crate) fn is_word(text: &str) -> bool {
    text.starts_with(is_part_of_word)
}

fn is_part_of_word(c: char) -> bool {
    c == '_' || c.is_ascii_alphanumeric()
}

/// Splits a file into tokens without comments. Checks that brackets are balanced.
pub(crate) fn tokens(source: &str) -> Result<Vec<Token<'_>>> {
    let mut tokens: Vec<Token> = Vec::new();
    // The brackets that close the open pairs, and the lines where the pairs begin.
    let mut open = Vec::new();
    for (text, line) in source.lines().zip(1..) {
        let mut rest = text.split("//").next().unwrap_or_default().trim_end();
        while !rest.is_empty() {
            let (gap, after) = rest.split_at(rest.len() - rest.trim_start().len());
            let (text, after) = after.split_at(token_length(after));
            let is_template = gap.is_empty() && tokens.last().is_some_and(|t| is_word(t.text));
            let closes = open.last().is_some_and(|(bracket, _)| *bracket == text);
            let depth = open.len() - usize::from(closes);
            match text {
                _ if closes => open.truncate(depth),
                "(" => open.push((")", line)),
                "[" => open.push(("]", line)),
                "{" => open.push(("}", line)),
                "<" if is_template => open.push((">", line)),
                ")" | "]" | "}" => bail!("{line}: unbalanced `{text}`"),
                _ => {}
            }
            tokens.push(Token {
                text,
                gap,
                line,
                depth,
            });
            rest = after;
        }
    }
    match open.pop() {
        Some((bracket, line)) => bail!("{line}: no `{bracket}` closes the bracket"),
        None => Ok(tokens),
    }
}

/// Returns the length of the token that begins a text: a word, `@` and a word, or an operator.
fn token_length(text: &str) -> usize {
    let start = usize::from(text.starts_with('@'));
    let end = text[start..].find(|c| !is_part_of_word(c));
    match end.map_or(text.len(), |end| start + end) {
        0 if ["::", "&&", "||"].iter().any(|pair| text.starts_with(pair)) => 2,
        0 => text.chars().next().map_or(0, char::len_utf8),
        length => length,
    }
}

/// Splits the first import, declaration, statement, member or parameter from the tokens.
fn split_item<'t, 'a>(tokens: &'t [Token<'a>]) -> (&'t [Token<'a>], &'t [Token<'a>]) {
    let depth = tokens.first().map_or(0, |t| t.depth);
    for (i, token) in tokens.iter().enumerate() {
        if token.depth < depth {
            // The bracket around the item.
            return tokens.split_at(i);
        }
        let next = tokens.get(i + 1).map_or("", |t| t.text);
        let is_last = match token.text {
            ";" | "," => true,
            "}" => !matches!(next, "else" | ";"),
            _ => false,
        };
        if is_last && token.depth == depth {
            return tokens.split_at(i + 1);
        }
    }
    (tokens, &[])
}

fn take(rest: &mut &[Token], text: &str) -> bool {
    let is_first = rest.first().is_some_and(|t| t.text == text);
    *rest = &rest[usize::from(is_first)..];
    is_first
}

impl Conditions<'_> {
    /// Evaluates the name, negation or bracket at the beginning of `rest`, and removes it. As in WGSL, `&&` and `||` are not
    /// mixed without brackets.
    fn evaluate(&self, rest: &mut &[Token]) -> Result<bool> {
        let (Token { text, line, .. }, after) = rest.split_first().context("no condition")?;
        *rest = after;
        match *text {
            "!" => Ok(!self.evaluate(rest)?),
            "(" => {
                let mut value = self.evaluate(rest)?;
                let operator = rest.first().map_or("", |t| t.text);
                while matches!(operator, "&&" | "||") && take(rest, operator) {
                    let other = self.evaluate(rest)?;
                    value = match operator {
                        "&&" => value && other,
                        _ => value || other,
                    };
                }
                ensure!(take(rest, ")"), "{line}: invalid condition");
                Ok(value)
            }
            name => {
                let is_known = self.known.contains(name);
                ensure!(is_known, "{line}: unknown condition `{name}`");
                Ok(self.on.is_some_and(|on| on.contains(&name)))
            }
        }
    }

    /// Appends the tokens that remain under these conditions to `kept`.
    fn select<'a>(&self, mut tokens: &[Token<'a>], kept: &mut Vec<Token<'a>>) -> Result<()> {
        // Whether an earlier branch holds. `None` where no `@elif` or `@else` may follow.
        let mut earlier = None;
        while let Some((first, mut rest)) = tokens.split_first() {
            let Token {
                text, line, gap, ..
            } = *first;
            let is_decided = match text {
                "@if" => Some(false),
                "@elif" | "@else" => earlier,
                _ => {
                    kept.push(*first);
                    (tokens, earlier) = (rest, None);
                    continue;
                }
            };
            let error = || format!("{line}: `{text}` does not follow `@if`");
            let is_decided = is_decided.with_context(error)?;
            let holds = text == "@else" || self.evaluate(&mut rest)?;
            let (item, others) = split_item(rest);
            if self.on.is_none() || holds && !is_decided {
                let start = kept.len();
                self.select(item, kept)?;
                if let Some(token) = kept.get_mut(start) {
                    token.gap = gap;
                }
            }
            earlier = (text != "@else").then_some(holds || is_decided);
            tokens = others;
        }
        Ok(())
    }
}

/// Returns the imports and declarations that remain under these conditions.
pub(crate) fn items<'a>(tokens: &[Token<'a>], conditions: &Conditions) -> Result<Vec<Item<'a>>> {
    let (mut kept, mut items) = (Vec::new(), Vec::new());
    conditions.select(tokens, &mut kept)?;
    let mut rest = &kept[..];
    while let [first, ..] = rest {
        let (item, others) = split_item(rest);
        let texts: Vec<_> = item.iter().map(|t| t.text).collect();
        let found = match texts[..] {
            ["import", ..] => imports(&item[1..], false),
            ["@publish", "import", ..] => imports(&item[2..], true),
            _ => declaration(item).map(|found| vec![found]),
        };
        let error = || format!("{}: `{}` begins no declaration", first.line, first.text);
        items.extend(found.with_context(error)?);
        rest = others;
    }
    Ok(items)
}

fn declaration<'a>(tokens: &[Token<'a>]) -> Option<Item<'a>> {
    let mut outer = tokens.iter().filter(|t| t.depth == 0);
    let kinds = ["fn", "struct", "const", "var", "alias", "override"];
    outer.find(|t| kinds.contains(&t.text))?;
    let name = outer.find(|t| is_word(t.text))?;
    Some(Item {
        name: name.text,
        line: name.line,
        tokens: tokens.to_vec(),
        import: None,
    })
}

/// Returns the names of an import statement from the tokens after `import`.
fn imports<'a>(tokens: &[Token<'a>], is_published: bool) -> Option<Vec<Item<'a>>> {
    let end = tokens.iter().rposition(|t| t.text == "::")?;
    let path: String = tokens[..end].iter().map(|t| t.text).collect();
    let path = path.strip_prefix("package::")?.replace("::", "/");
    let names = tokens[end + 1..].split(|t| matches!(t.text, "{" | "," | "}" | ";"));
    let item = |name: &[Token<'a>]| {
        let (original, name) = match name {
            [name] => (name, name),
            [original, word, name] if word.text == "as" => (original, name),
            _ => return None,
        };
        Some(Item {
            name: name.text,
            line: name.line,
            tokens: Vec::new(),
            import: Some(Import {
                path: path.clone(),
                original: original.text,
                is_published,
            }),
        })
    };
    names.filter(|name| !name.is_empty()).map(item).collect()
}
