//! A kernel from its file and what that imports: plain WGSL with one entry point, without what that does not use.
//!
//! Files are in WESL (<https://wesl-lang.dev>), of which this reads what they need: imports of names from other files, and
//! `@if`, `@elif` and `@else` before declarations and statements.

use anyhow::{Context, Result, bail, ensure};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::read_to_string;
use std::ops::Range;
use std::path::Path;

/// All files, by their paths from the folder `wgsl` on without extension.
pub(crate) struct Sources(BTreeMap<String, File>);

/// A file as it stands, and what it imports and declares: under which condition, by which name.
struct File {
    text: String,
    items: Vec<(Condition, String, Item)>,
}

/// Names, `!`, `&&`, `||` and parentheses; what is empty holds.
type Condition = String;

enum Item {
    Import(Import),
    /// Parts of a text, under conditions of their own.
    Declaration(Vec<(Condition, Part)>),
}

/// A name of another file, and whether it may be imported from here.
struct Import {
    file: String,
    name: String,
    published: bool,
}

struct Part {
    text: String,
    /// Words that stand for what the file imports or declares, if there is anything of that name.
    references: Vec<Range<usize>>,
}

impl Sources {
    pub(crate) fn read(root: &Path) -> Result<Self> {
        let mut files = BTreeMap::new();
        for folder in root.read_dir().context("wgsl")? {
            for file in folder?.path().read_dir().context("a folder in wgsl")? {
                let path = file?.path();
                let name = path.strip_prefix(root)?.with_extension("");
                let file = read_to_string(&path)
                    .map_err(Into::into)
                    .and_then(File::read);
                let file = file.with_context(|| path.display().to_string())?;
                files.insert(name.to_string_lossy().into_owned(), file);
            }
        }
        Ok(Self(files))
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        let all = self.0.iter();
        all.map(|(name, file)| (name.as_str(), file.text.as_str()))
    }

    /// Entry points of a file with all that they use. Conditions hold that are named in `on`; those in neither list are errors.
    /// Names are those of the declarations: hosts find buffers by them, and a name stands for one thing in all files.
    pub(crate) fn compose(
        &self,
        file: &str,
        entries: &[&str],
        on: &[&str],
        off: &[&str],
    ) -> Result<String> {
        let mut module = Module {
            sources: self,
            on,
            off,
            scopes: Vec::new(),
            used: BTreeSet::new(),
        };
        let scope = module.scope(file)?;
        for entry in entries {
            module.take(scope, entry)?;
        }
        Ok(number_bindings(&module.text()?))
    }
}

impl File {
    fn read(text: String) -> Result<Self> {
        let mut items = Vec::new();
        let code = without_comments(&text);
        let mut rest = code.trim_start();
        while !rest.is_empty() {
            for (condition, item) in chain(&mut rest)? {
                match imports(item) {
                    Some(all) => items.extend(all.map(|(name, i)| (condition.clone(), name, i))),
                    None => items.push((condition, name_of(item)?, declaration(item)?)),
                }
            }
            rest = rest.trim_start();
        }
        Ok(Self { text, items })
    }
}

/// A text without comments and empty lines.
fn without_comments(text: &str) -> String {
    let code = |line: &str| {
        line.split("//")
            .next()
            .unwrap_or_default()
            .trim_end()
            .to_owned()
    };
    let lines = text.lines().map(code).filter(|line| !line.is_empty());
    lines.map(|line| line + "\n").collect()
}

/// Takes an item or statement off the front of a text; or several, each of which stands if its condition holds and no earlier one.
fn chain<'a>(rest: &mut &'a str) -> Result<Vec<(Condition, &'a str)>> {
    let (mut all, mut unless) = (Vec::new(), String::new());
    let mut word = "@if";
    while let Some(after) = rest.strip_prefix(word) {
        let end = after.find('\n').context("a line for a condition")?;
        let condition = &after[..end];
        *rest = &after[end..];
        all.push((format!("{unless}{condition}"), item(rest)?));
        unless = format!("{unless}!{condition} && ");
        let next = rest.trim_start();
        let more = ["@elif", "@else"].into_iter().find(|w| next.starts_with(w));
        match more.filter(|_| word != "@else") {
            Some(more) => (word, *rest) = (more, next),
            None => return Ok(all),
        }
    }
    Ok(vec![(Condition::new(), item(rest)?)])
}

/// Takes one off the front, which ends with a semicolon or braces.
fn item<'a>(rest: &mut &'a str) -> Result<&'a str> {
    let text = rest.trim_start();
    let mut depth = 0;
    for (i, c) in text.char_indices() {
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            _ => {}
        }
        let goes_on = text[i + 1..].starts_with(';');
        if depth == 0 && (c == ';' || c == '}' && !goes_on) {
            *rest = &text[i + 1..];
            return Ok(&text[..=i]);
        }
    }
    bail!("no end of {text}")
}

/// What `import package::folder::file::{one, other as another};` imports; nothing if that is no import.
fn imports(item: &str) -> Option<impl Iterator<Item = (String, Item)>> {
    let published = item.strip_prefix("@publish");
    let path = published.unwrap_or(item).trim_start();
    let path = path.strip_prefix("import package::")?.strip_suffix(';')?;
    let (file, names) = path.rsplit_once("::")?;
    let names = names.trim_matches(['{', '}']).split(',').map(str::trim);
    let one = move |text: &str| {
        let (name, here) = text.split_once(" as ").unwrap_or((text, text));
        let import = Import {
            file: file.replace("::", "/"),
            name: name.to_owned(),
            published: published.is_some(),
        };
        (here.to_owned(), Item::Import(import))
    };
    Some(names.filter(|name| !name.is_empty()).map(one))
}

fn name_of(declaration: &str) -> Result<String> {
    let mut all = words(declaration);
    let keywords = ["fn", "struct", "const", "var", "alias"];
    let keyword = all.find(|w| keywords.contains(&&declaration[w.clone()]));
    let after = &declaration[keyword.context("a declaration")?.end..];
    let after = match after.strip_prefix('<') {
        Some(space) => space.split_once('>').context("an address space")?.1,
        None => after,
    };
    let name = words(after).next().context("a name")?;
    Ok(after[name].to_owned())
}

fn declaration(mut text: &str) -> Result<Item> {
    let local = local_names(text);
    let part = |(condition, text): (Condition, &str)| (condition, Part::new(text, &local));
    let mut parts = Vec::new();
    while let Some(at) = text.find("@if") {
        parts.push(part((Condition::new(), &text[..at])));
        text = &text[at..];
        parts.extend(chain(&mut text)?.into_iter().map(part));
    }
    parts.push(part((Condition::new(), text)));
    Ok(Item::Declaration(parts))
}

impl Part {
    fn new(text: &str, local: &BTreeSet<&str>) -> Self {
        let is_reference = |w: &Range<usize>| {
            let is_member = text[..w.start].ends_with('.');
            let is_called = text[w.end..].starts_with('(');
            !is_member && (is_called || !local.contains(&text[w.clone()]))
        };
        Self {
            text: text.to_owned(),
            references: words(text).filter(is_reference).collect(),
        }
    }
}

/// Places of words and numbers.
fn words(text: &str) -> impl Iterator<Item = Range<usize>> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = at + text[at..].find(is_word)?;
        let end = text[start..].find(|c| !is_word(c));
        at = end.map_or(text.len(), |length| start + length);
        Some(start..at)
    })
}

/// Names of variables, parameters and members.
fn local_names(text: &str) -> BTreeSet<&str> {
    let mut before = "";
    let mut all = BTreeSet::new();
    for place in words(text) {
        let is_typed = text[place.end..].starts_with(':');
        let word = &text[place];
        if is_typed || ["let", "var", "const"].contains(&before) {
            all.insert(word);
        }
        before = word;
    }
    all
}

/// The number of a file, and a declaration in it.
type Found<'a> = (usize, &'a str, &'a [(Condition, Part)]);

/// A module in the making.
struct Module<'a> {
    sources: &'a Sources,
    on: &'a [&'a str],
    off: &'a [&'a str],
    /// Files in the order in which they were met.
    scopes: Vec<Scope<'a>>,
    /// Names of declarations, with the numbers of their files.
    used: BTreeSet<(usize, &'a str)>,
}

/// A file under the conditions that hold.
struct Scope<'a> {
    file: &'a str,
    items: Vec<(&'a str, &'a Item)>,
    /// Places in `items`.
    names: HashMap<&'a str, usize>,
}

impl<'a> Module<'a> {
    /// The number of a file, which has been met or is now.
    fn scope(&mut self, file: &str) -> Result<usize> {
        if let Some(known) = self.scopes.iter().position(|s| s.file == file) {
            return Ok(known);
        }
        let found = self.sources.0.get_key_value(file);
        let (file, source) = found.with_context(|| format!("no file {file}"))?;
        let (mut items, mut names) = (Vec::new(), HashMap::new());
        for (condition, name, item) in &source.items {
            if self.holds(condition)? {
                let other = names.insert(name.as_str(), items.len());
                ensure!(other.is_none(), "{name} stands for two things in {file}");
                items.push((name.as_str(), item));
            }
        }
        self.scopes.push(Scope { file, items, names });
        Ok(self.scopes.len() - 1)
    }

    /// The declaration that a name stands for in a file, the number of its file, and its own name; nothing for names of WGSL.
    fn find(&mut self, mut scope: usize, name: &str) -> Result<Option<Found<'a>>> {
        let Scope { names, items, .. } = &self.scopes[scope];
        let Some(mut item) = names.get(name).map(|&at| items[at]) else {
            return Ok(None);
        };
        let mut inside = true;
        while let (name, Item::Import(import)) = item {
            let file = self.scopes[scope].file;
            let may = inside || import.published;
            ensure!(may, "{name} is not published by {file}");
            inside = false;
            scope = self.scope(&import.file)?;
            let there = self.scopes[scope].names.get(import.name.as_str());
            let at = there.with_context(|| format!("no {} in {}", import.name, import.file))?;
            item = self.scopes[scope].items[*at];
        }
        let (name, Item::Declaration(parts)) = item else {
            bail!("{name} leads nowhere");
        };
        Ok(Some((scope, name, parts)))
    }

    /// Takes a declaration and all that it refers to.
    fn take(&mut self, scope: usize, name: &str) -> Result<()> {
        let Some((scope, name, parts)) = self.find(scope, name)? else {
            return Ok(());
        };
        if self.used.insert((scope, name)) {
            for (condition, part) in parts {
                if self.holds(condition)? {
                    let mut words = part.references.iter().map(|w| &part.text[w.clone()]);
                    words.try_for_each(|word| self.take(scope, word))?;
                }
            }
        }
        Ok(())
    }

    /// All that was taken, under the names by which it is declared.
    fn text(&mut self) -> Result<String> {
        let mut text = String::new();
        for scope in 0..self.scopes.len() {
            for (name, item) in self.scopes[scope].items.clone() {
                if let Item::Declaration(parts) = item
                    && self.used.contains(&(scope, name))
                {
                    self.write(scope, parts, &mut text)?;
                }
            }
        }
        Ok(text)
    }

    fn write(&mut self, scope: usize, parts: &[(Condition, Part)], to: &mut String) -> Result<()> {
        for (condition, part) in parts {
            if !self.holds(condition)? {
                continue;
            }
            let mut written = 0;
            for place in &part.references {
                if let Some((_, name, _)) = self.find(scope, &part.text[place.clone()])? {
                    to.push_str(&part.text[written..place.start]);
                    to.push_str(name);
                    written = place.end;
                }
            }
            to.push_str(&part.text[written..]);
        }
        to.push('\n');
        Ok(())
    }

    fn holds(&self, condition: &str) -> Result<bool> {
        let condition = condition.trim();
        if let Some((a, b)) = split_outside(condition, "||") {
            return Ok(self.holds(a)? || self.holds(b)?);
        }
        if let Some((a, b)) = split_outside(condition, "&&") {
            return Ok(self.holds(a)? && self.holds(b)?);
        }
        if let Some(negated) = condition.strip_prefix('!') {
            return Ok(!self.holds(negated)?);
        }
        let inner = condition
            .strip_prefix('(')
            .and_then(|c| c.strip_suffix(')'));
        if let Some(inner) = inner {
            return self.holds(inner);
        }
        let on = condition.is_empty() || self.on.contains(&condition);
        ensure!(
            on || self.off.contains(&condition),
            "no condition {condition}"
        );
        Ok(on)
    }
}

/// What stands before and after an operator that no parentheses enclose.
fn split_outside<'a>(expression: &'a str, operator: &str) -> Option<(&'a str, &'a str)> {
    let places = expression.match_indices(operator).map(|(at, _)| at);
    let parts = places.map(|at| (&expression[..at], &expression[at + operator.len()..]));
    let is_outside = |text: &str| text.matches('(').count() == text.matches(')').count();
    parts.into_iter().find(|(before, _)| is_outside(before))
}

/// Gives each `@binding(next)` its number, from 1 on: the parameters have number 0.
fn number_bindings(source: &str) -> String {
    let mut parts = source.split("@binding(next)");
    let mut numbered = parts.next().unwrap_or_default().to_owned();
    for (i, part) in parts.enumerate() {
        numbered.push_str(&format!("@binding({})", i + 1));
        numbered.push_str(part);
    }
    numbered
}
