//! Composes a kernel from its file and its imports: plain WGSL with its entry points, without unused declarations.

use crate::syntax::{Conditions, Import, Item, Token, is_word, items, tokens};
use anyhow::{Context, Error, Result, anyhow, ensure};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::mem;

/// Contents of files, by path relative to the folder `wgsl` and without extension.
pub(crate) type Files = BTreeMap<String, String>;

/// The tokens of all files, and the conditions that they may use.
pub(crate) struct Sources<'a> {
    files: BTreeMap<&'a str, Vec<Token<'a>>>,
    conditions: BTreeSet<String>,
}

impl<'a> Sources<'a> {
    /// Splits files into tokens. Checks the conditions and imports of all branches.
    pub(crate) fn new(files: &'a Files, conditions: BTreeSet<String>) -> Result<Self> {
        let files = files.iter().map(|(path, text)| {
            let tokens = tokens(text).map_err(in_file(path))?;
            Ok((path.as_str(), tokens))
        });
        let files = files.collect::<Result<_>>()?;
        let sources = Self { files, conditions };
        let all = sources.files.keys();
        let all = all.map(|path| Ok((*path, sources.items(path, None)?)));
        let all: BTreeMap<_, _> = all.collect::<Result<_>>()?;
        for (path, items) in &all {
            check_imports(items, &all).map_err(in_file(path))?;
        }
        Ok(sources)
    }

    /// Returns the items of a file where the conditions `on` hold. `None` selects all branches.
    fn items(&self, path: &str, on: Option<&[&str]>) -> Result<Vec<Item<'a>>> {
        let known = &self.conditions;
        items(&self.files[path], &Conditions { known, on }).map_err(in_file(path))
    }

    /// Returns the entry points of a file with everything they use, where the conditions `on` hold. Adds `prefix` to the
    /// names of all other declarations.
    ///
    /// Files follow each other in the order of their first use, and declarations in the order of their file.
    pub(crate) fn compose(
        &self,
        path: &str,
        entries: &[&str],
        prefix: &str,
        on: &[&str],
    ) -> Result<String> {
        let mut composer = Composer {
            sources: self,
            entries,
            prefix,
            on,
            files: Vec::new(),
            texts: BTreeMap::new(),
        };
        let file = composer.load(path)?;
        for entry in entries {
            let place = composer.find(file, entry)?;
            composer.add(place.with_context(|| format!("wgsl/{path}.wgsl has no `{entry}`"))?)?;
        }
        let texts: Vec<_> = composer.texts.into_values().collect();
        Ok(number_bindings(&texts.join("\n")))
    }
}

/// Adds the file to an error that begins with a line number.
fn in_file(path: &str) -> impl Fn(Error) -> Error {
    move |error| anyhow!("wgsl/{path}.wgsl:{error}")
}

/// Checks that the file uses or publishes each import, and that the imported file has the name in some branch.
fn check_imports(items: &[Item], all: &BTreeMap<&str, Vec<Item>>) -> Result<()> {
    let words = items.iter().flat_map(|item| &item.tokens);
    let words: HashSet<_> = words.map(|token| token.text).collect();
    let is_public = |i: &Item| i.import.as_ref().is_none_or(|import| import.is_published);
    for item @ Item { name, line, .. } in items {
        let Some(Import { path, original, .. }) = &item.import else {
            continue;
        };
        let mut others = all.get(&**path).into_iter().flatten();
        let is_found = others.any(|other| other.name == *original && is_public(other));
        ensure!(is_found, "{line}: wgsl/{path}.wgsl has no `{original}`");
        let is_used = words.contains(name) || is_public(item);
        ensure!(is_used, "{line}: unused import `{name}`");
    }
    Ok(())
}

struct File<'a> {
    path: String,
    items: Vec<Item<'a>>,
    /// Indices of items by name.
    names: HashMap<&'a str, usize>,
}

/// Indices of a file and of an item in it.
type Place = (usize, usize);

/// Adds declarations to a text, each with everything that it uses.
struct Composer<'a, 'c> {
    sources: &'c Sources<'a>,
    entries: &'c [&'c str],
    prefix: &'c str,
    on: &'c [&'c str],
    /// Files in the order of their first use.
    files: Vec<File<'a>>,
    texts: BTreeMap<Place, String>,
}

impl Composer<'_, '_> {
    /// Returns the index of a file. Reads its items at its first use.
    fn load(&mut self, path: &str) -> Result<usize> {
        if let Some(index) = self.files.iter().position(|file| file.path == path) {
            return Ok(index);
        }
        let items = self.sources.items(path, Some(self.on))?;
        let mut names = HashMap::new();
        for (i, Item { name, line, .. }) in items.iter().enumerate() {
            let is_new = names.insert(*name, i).is_none();
            ensure!(
                is_new,
                "wgsl/{path}.wgsl:{line}: `{name}` is declared twice"
            );
        }
        let path = path.to_owned();
        self.files.push(File { path, items, names });
        Ok(self.files.len() - 1)
    }

    /// Returns the declaration that a name refers to in a file. Returns `None` for local and predeclared names.
    fn find(&mut self, file: usize, name: &str) -> Result<Option<Place>> {
        let Some(&at) = self.files[file].names.get(name) else {
            return Ok(None);
        };
        let Item { import, line, .. } = &self.files[file].items[at];
        let Some(Import { path, original, .. }) = import.clone() else {
            return Ok(Some((file, at)));
        };
        let line = *line;
        let imported = self.load(&path)?;
        let found = self.find(imported, original)?;
        found.map(Some).with_context(|| {
            let (file, on) = (&self.files[file].path, self.on.join(", "));
            format!("wgsl/{file}.wgsl:{line}: wgsl/{path}.wgsl has no `{original}` under {on}")
        })
    }

    fn add(&mut self, place: Place) -> Result<()> {
        if self.texts.contains_key(&place) {
            return Ok(());
        }
        self.texts.insert(place, String::new());
        // The tokens of a declaration are needed once.
        let tokens = mem::take(&mut self.files[place.0].items[place.1].tokens);
        let (mut text, mut line) = (String::new(), tokens[0].line);
        for (i, token) in tokens.iter().enumerate() {
            if token.line > line {
                text.push('\n');
                line = token.line;
            }
            text += token.gap;
            match self.reference(place.0, &tokens, i)? {
                Some(used) => {
                    self.add(used)?;
                    text += &self.name(used);
                }
                None => text += token.text,
            }
        }
        self.texts.insert(place, text + "\n");
        Ok(())
    }

    /// Returns the declaration that token `i` of a declaration in `file` refers to, if any.
    fn reference(&mut self, file: usize, tokens: &[Token], i: usize) -> Result<Option<Place>> {
        let token = &tokens[i];
        let text_at = |i: usize| tokens.get(i).map_or("", |token| token.text);
        let (previous, next) = (text_at(i.wrapping_sub(1)), text_at(i + 1));
        if !is_word(token.text) || previous == "." {
            return Ok(None);
        }
        let found = self.find(file, token.text)?;
        let is_local = next == ":" || matches!(previous, "let" | "var" | "const");
        if found.is_none() || token.depth == 0 || !is_local {
            return Ok(found);
        }
        let is_member = tokens.iter().any(|t| t.depth == 0 && t.text == "struct");
        let (path, Token { text, line, .. }) = (&self.files[file].path, token);
        ensure!(
            is_member,
            "wgsl/{path}.wgsl:{line}: local name `{text}` hides a declaration"
        );
        Ok(None)
    }

    /// Returns the name of a declaration in the text.
    fn name(&self, (file, at): Place) -> String {
        let name = self.files[file].items[at].name;
        let is_entry = self.entries.contains(&name);
        [if is_entry { "" } else { self.prefix }, name].concat()
    }
}

/// Numbers each `@binding(next)`, from 1 on. Binding 0 holds the parameters.
fn number_bindings(source: &str) -> String {
    let mut parts = source.split("@binding(next)");
    let first = parts.next().unwrap_or_default().to_owned();
    let number = |all, (part, i)| format!("{all}@binding({i}){part}");
    parts.zip(1..).fold(first, number)
}
