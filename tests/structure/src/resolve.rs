//! From a path as it is written to the file that defines what it names.

use std::collections::BTreeMap;
use std::path::Path;

use crate::graph::Graph;
use crate::source::Module;

/// Longer chains of re-exports than anybody writes.
const DEPTH: usize = 16;

/// Every file of the modules, with the files whose items it names.
pub fn arrows(modules: &[Module]) -> Graph {
    let names = Resolver::new(modules);
    let mut graph = Graph::new();
    for module in modules {
        let from = module.file.clone();
        graph.entry(from.clone()).or_default();
        for path in &module.uses {
            let Some(to) = names.file(module, path, DEPTH) else {
                continue;
            };
            if to != from {
                let tied = graph.entry(from.clone()).or_default();
                let what = path.last().cloned().unwrap_or_default();
                tied.entry(to.to_owned()).or_default().insert(what);
            }
        }
    }
    graph
}

/// Where a name is defined.
pub(crate) struct Found<'a> {
    pub(crate) module: &'a Module,
    /// None for the module itself, and where the item cannot be told.
    pub(crate) item: Option<String>,
}

pub(crate) struct Resolver<'a> {
    index: BTreeMap<&'a [String], &'a Module>,
}

impl<'a> Resolver<'a> {
    pub(crate) fn new(modules: &'a [Module]) -> Self {
        let index = modules.iter().map(|m| (m.path.as_slice(), m)).collect();
        Self { index }
    }

    pub(crate) fn module(&self, path: &[String]) -> Option<&'a Module> {
        self.index.get(path).copied()
    }

    /// Where what a name that stands in `module` is defined.
    pub(crate) fn name(&self, module: &'a Module, name: &str) -> Option<Found<'a>> {
        self.descend(module, &[name.to_owned()], DEPTH)
    }

    /// The file that defines what `path` means in `module`; none for names of other crates.
    fn file(&self, module: &Module, path: &[String], depth: usize) -> Option<&'a Path> {
        let found = self.definition(module, path, depth)?;
        Some(&found.module.file)
    }

    /// Where what `path` means in `module` is defined; none for names of other crates.
    fn definition(&self, module: &Module, path: &[String], depth: usize) -> Option<Found<'a>> {
        let depth = depth.checked_sub(1)?;
        let here = *self.index.get(module.path.as_slice())?;
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            // The visibility `pub(super)`, not a path.
            "crate" | "super" if rest.is_empty() => None,
            "crate" => self.descend(self.index.get(&[][..])?, rest, depth),
            "self" if !rest.is_empty() => self.descend(here, rest, depth),
            "super" => {
                let (_, parent) = here.path.split_last()?;
                let parent = self.index.get(parent)?;
                match rest.first().map(String::as_str) {
                    Some("super") => self.definition(parent, rest, depth),
                    _ => self.descend(parent, rest, depth),
                }
            }
            name if here.children.contains(name) && !rest.is_empty() => {
                self.descend(here, path, depth)
            }
            name => match here.aliases.get(name) {
                // A name brought in by `use` counts where the `use` stands.
                Some(_) if rest.is_empty() => None,
                Some(target) if target.first() != Some(first) => {
                    let whole: Vec<String> = target.iter().chain(rest).cloned().collect();
                    self.definition(here, &whole, depth)
                }
                _ => None,
            },
        }
    }

    /// `path` looked up from inside `module`.
    fn descend(&self, module: &'a Module, path: &[String], depth: usize) -> Option<Found<'a>> {
        let depth = depth.checked_sub(1)?;
        let Some((first, rest)) = path.split_first() else {
            return Some(Found { module, item: None });
        };
        if module.items.contains(first) {
            let item = Some(first.clone());
            return Some(Found { module, item });
        }
        if module.children.contains(first) {
            let mut child = module.path.clone();
            child.push(first.clone());
            let child = self.index.get(child.as_slice())?;
            return self.descend(child, rest, depth);
        }
        if let Some(target) = module.aliases.get(first) {
            // Of a name that another crate defines no file is known.
            return self.definition(module, target, depth).or_else(|| {
                let children = target.first().map(|t| module.children.contains(t));
                (children == Some(true)).then_some(Found { module, item: None })
            });
        }
        module
            .globs
            .iter()
            .find_map(|glob| {
                let whole: Vec<String> = glob.iter().chain(path).cloned().collect();
                self.definition(module, &whole, depth)
            })
            .or(Some(Found { module, item: None }))
    }
}
