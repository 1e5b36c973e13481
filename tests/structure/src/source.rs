//! A crate's source as modules: what each defines, re-exports and names.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// A path of names, as written: `crate::pair::Pair`.
pub(crate) type Names = Vec<String>;

/// One module of a crate.
#[derive(Debug, Default)]
pub struct Module {
    /// Its place in the crate; empty for the root.
    pub path: Vec<String>,
    /// The file that holds it, relative to the crate's source folder.
    pub file: PathBuf,
    /// Child modules.
    pub(crate) children: BTreeSet<String>,
    /// Items and macros defined here.
    pub(crate) items: BTreeSet<String>,
    /// Names that `use` brings in, and what they stand for.
    pub(crate) aliases: BTreeMap<String, Names>,
    /// Of the items those that are types or traits.
    pub(crate) types: BTreeSet<String>,
    /// Children, items and re-exports that are `pub` without restriction.
    pub(crate) public: BTreeSet<String>,
    /// Modules of which `use` brings in everything.
    pub(crate) globs: Vec<Names>,
    /// Paths named in code and in imports that are not re-exports.
    pub(crate) uses: Vec<Names>,
}

/// Why source cannot be read.
#[derive(Debug)]
pub enum SourceError {
    /// A file cannot be read.
    Io(PathBuf, std::io::Error),
    /// A file is not Rust.
    Tokens(PathBuf, String),
    /// A module has no file.
    NoFile(PathBuf, String),
}

impl std::fmt::Display for SourceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Io(path, e) => write!(f, "{}: {e}", path.display()),
            Self::Tokens(path, e) => write!(f, "{}: not Rust: {e}", path.display()),
            Self::NoFile(path, name) => {
                write!(f, "{}: no file for module {name}", path.display())
            }
        }
    }
}

impl std::error::Error for SourceError {}

/// Reads the modules that `root` (a `lib.rs` or `main.rs`) and its children make.
///
/// # Errors
/// If a file is missing or is not Rust.
pub fn read_crate(root: &Path) -> Result<Vec<Module>, SourceError> {
    let base = root.parent().unwrap_or(Path::new(".")).to_owned();
    let mut modules = Vec::new();
    let file = Place {
        file: root.to_owned(),
        folder: base.clone(),
    };
    read_file(&file, Vec::new(), &base, &mut modules)?;
    Ok(modules)
}

/// A file and the folder in which its children lie.
struct Place {
    file: PathBuf,
    folder: PathBuf,
}

fn read_file(
    place: &Place,
    path: Vec<String>,
    base: &Path,
    modules: &mut Vec<Module>,
) -> Result<(), SourceError> {
    let text =
        std::fs::read_to_string(&place.file).map_err(|e| SourceError::Io(place.file.clone(), e))?;
    let tokens: TokenStream = text
        .parse()
        .map_err(|e| SourceError::Tokens(place.file.clone(), format!("{e}")))?;
    read_module(tokens, place, path, base, modules)
}

fn read_module(
    tokens: TokenStream,
    place: &Place,
    path: Vec<String>,
    base: &Path,
    modules: &mut Vec<Module>,
) -> Result<(), SourceError> {
    let mut reader = Reader {
        tokens: tokens.into_iter().collect(),
        at: 0,
        module: Module {
            file: place.file.strip_prefix(base).unwrap_or(&place.file).into(),
            path: path.clone(),
            ..Module::default()
        },
        inner: Vec::new(),
    };
    reader.items();
    let inner = std::mem::take(&mut reader.inner);
    modules.push(reader.module);
    for child in inner {
        let mut path = path.clone();
        path.push(child.name.clone());
        let folder = place.folder.join(&child.name);
        match child.body {
            Some(tokens) => {
                let here = Place {
                    file: place.file.clone(),
                    folder,
                };
                read_module(tokens, &here, path, base, modules)?;
            }
            None => {
                let beside = place.folder.join(format!("{}.rs", child.name));
                let below = folder.join("mod.rs");
                let file = [beside, below]
                    .into_iter()
                    .find(|f| f.exists())
                    .ok_or_else(|| SourceError::NoFile(place.file.clone(), child.name.clone()))?;
                read_file(&Place { file, folder }, path, base, modules)?;
            }
        }
    }
    Ok(())
}

/// A module declared in another.
struct Child {
    name: String,
    /// Its tokens, if it has no file of its own.
    body: Option<TokenStream>,
}

const DEFINING: [&str; 8] = [
    "struct", "enum", "union", "trait", "fn", "type", "const", "static",
];

const TYPES: [&str; 5] = ["struct", "enum", "union", "trait", "type"];

struct Reader {
    tokens: Vec<TokenTree>,
    at: usize,
    module: Module,
    inner: Vec<Child>,
}

impl Reader {
    fn word(&self, ahead: usize) -> Option<String> {
        match self.tokens.get(self.at + ahead) {
            Some(TokenTree::Ident(i)) => Some(i.to_string()),
            _ => None,
        }
    }

    fn punct(&self, ahead: usize) -> Option<char> {
        match self.tokens.get(self.at + ahead) {
            Some(TokenTree::Punct(p)) => Some(p.as_char()),
            _ => None,
        }
    }

    fn group(&self, ahead: usize) -> Option<(Delimiter, TokenStream)> {
        match self.tokens.get(self.at + ahead) {
            Some(TokenTree::Group(g)) => Some((g.delimiter(), g.stream())),
            _ => None,
        }
    }

    /// All items of a module.
    fn items(&mut self) {
        let (mut public, mut open) = (false, false);
        while self.at < self.tokens.len() {
            if self.is_test() {
                self.skip_item();
                continue;
            }
            match self.word(0).as_deref() {
                Some("pub") => {
                    (public, open) = (true, true);
                    self.at += 1;
                    if let Some((Delimiter::Parenthesis, _)) = self.group(0) {
                        self.at += 1;
                        open = false;
                    }
                    continue;
                }
                Some("use") => {
                    self.at += 1;
                    let before: BTreeSet<_> = self.module.aliases.keys().cloned().collect();
                    self.import(public);
                    let new = self.module.aliases.keys().filter(|a| !before.contains(*a));
                    self.module.public.extend(new.filter(|_| open).cloned());
                }
                Some("mod") => {
                    self.module.public.extend(self.word(1).filter(|_| open));
                    self.child();
                }
                Some("macro_rules") => {
                    if let Some(name) = self.word(2) {
                        self.module.items.insert(name);
                    }
                    self.at += 3;
                }
                Some(word) if DEFINING.contains(&word) && self.word(1).is_some() => {
                    // `const fn` and `unsafe fn` are defined by their last word.
                    let name = self.word(1).unwrap_or_default();
                    if name != "fn" {
                        self.module.public.extend(open.then(|| name.clone()));
                        if TYPES.contains(&word) {
                            self.module.types.insert(name.clone());
                        }
                        self.module.items.insert(name);
                    }
                    self.at += 1;
                    // `pub const fn f`: the visibility is that of its last word.
                    if self.word(0).as_deref() == Some("fn") {
                        continue;
                    }
                }
                // What may stand between a visibility and `fn`.
                Some("unsafe" | "async" | "extern" | "auto") => {
                    self.at += 1;
                    continue;
                }
                _ => self.code(),
            }
            (public, open) = (false, false);
        }
    }

    /// At `#[cfg(test)]` or another attribute of tests only.
    fn is_test(&self) -> bool {
        let Some('#') = self.punct(0) else {
            return false;
        };
        let Some((Delimiter::Bracket, inside)) = self.group(1) else {
            return false;
        };
        let text = inside.to_string().replace(' ', "");
        text == "test" || text.starts_with("cfg(test") || text.starts_with("cfg(all(test")
    }

    /// Past the attributes and the item after them: to the next braces or semicolon.
    fn skip_item(&mut self) {
        while self.at < self.tokens.len() {
            let end = match &self.tokens[self.at] {
                TokenTree::Punct(p) => p.as_char() == ';',
                TokenTree::Group(g) => g.delimiter() == Delimiter::Brace,
                _ => false,
            };
            self.at += 1;
            if end {
                return;
            }
        }
    }

    fn child(&mut self) {
        let Some(name) = self.word(1) else {
            self.at += 1;
            return;
        };
        let body = match self.group(2) {
            Some((Delimiter::Brace, tokens)) => Some(tokens),
            _ => None,
        };
        self.at += 3;
        self.module.children.insert(name.clone());
        self.inner.push(Child { name, body });
    }

    /// `use` up to its semicolon.
    fn import(&mut self, public: bool) {
        let begin = self.at;
        while self.at < self.tokens.len() && self.punct(0) != Some(';') {
            self.at += 1;
        }
        let tree = self.tokens[begin..self.at].to_vec();
        self.at += 1;
        self.import_tree(&tree, &[], public);
    }

    fn import_tree(&mut self, tree: &[TokenTree], before: &[String], public: bool) {
        let mut names = before.to_vec();
        let mut called = None;
        let mut tokens = tree.iter().peekable();
        while let Some(token) = tokens.next() {
            match token {
                TokenTree::Ident(i) if i == "as" => {
                    called = tokens.next().map(ToString::to_string);
                }
                TokenTree::Ident(i) => names.push(i.to_string()),
                TokenTree::Punct(p) if p.as_char() == '*' => {
                    self.module.globs.push(names.clone());
                    if !public {
                        self.module.uses.push(names);
                    }
                    return;
                }
                TokenTree::Group(g) => {
                    let inside: Vec<TokenTree> = g.stream().into_iter().collect();
                    let comma =
                        |t: &TokenTree| matches!(t, TokenTree::Punct(p) if p.as_char() == ',');
                    for branch in inside.split(comma) {
                        if !branch.is_empty() {
                            self.import_tree(branch, &names, public);
                        }
                    }
                    return;
                }
                _ => {}
            }
        }
        if names.last().is_some_and(|n| n == "self") {
            names.pop();
        }
        let Some(last) = names.last().cloned() else {
            return;
        };
        if !public {
            self.module.uses.push(names.clone());
        }
        self.module.aliases.insert(called.unwrap_or(last), names);
    }

    /// One token of code: paths are noted, groups are read inside.
    fn code(&mut self) {
        if let Some((_, inside)) = self.group(0) {
            self.at += 1;
            self.inside(inside);
            return;
        }
        let Some(first) = self.word(0) else {
            self.at += 1;
            return;
        };
        let mut names = vec![first];
        self.at += 1;
        while self.punct(0) == Some(':') && self.punct(1) == Some(':') {
            let Some(next) = self.word(2) else { break };
            names.push(next);
            self.at += 3;
        }
        self.module.uses.push(names);
    }

    /// The code within braces, brackets or parentheses; items in there belong to nobody else, but
    /// their imports count.
    fn inside(&mut self, tokens: TokenStream) {
        let mut reader = Reader {
            tokens: tokens.into_iter().collect(),
            at: 0,
            module: Module::default(),
            inner: Vec::new(),
        };
        while reader.at < reader.tokens.len() {
            if reader.is_test() {
                reader.skip_item();
            } else if reader.word(0).as_deref() == Some("use") {
                reader.at += 1;
                reader.import(false);
            } else {
                reader.code();
            }
        }
        self.module.uses.append(&mut reader.module.uses);
    }
}
