//! What a crate offers: every public item and the paths that lead to it.

use std::collections::{BTreeMap, BTreeSet};

use crate::resolve::Resolver;
use crate::source::Module;

/// A public item, by where it is defined.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Item {
    /// The module that defines it.
    pub module: Vec<String>,
    /// Its name there.
    pub name: String,
    /// A type or trait.
    pub is_type: bool,
}

/// The public items of a crate with the paths by which other crates can name each.
pub fn public_paths(modules: &[Module]) -> BTreeMap<Item, BTreeSet<String>> {
    let names = Resolver::new(modules);
    let mut found = BTreeMap::new();
    visit(&names, &[], &mut found);
    found
}

fn visit(names: &Resolver<'_>, path: &[String], found: &mut BTreeMap<Item, BTreeSet<String>>) {
    let Some(module) = names.module(path) else {
        return;
    };
    for name in &module.public {
        let whole = [path, std::slice::from_ref(name)].concat();
        if module.children.contains(name) {
            visit(names, &whole, found);
        }
        let Some(place) = names.name(module, name) else {
            continue;
        };
        // Modules, and what other crates define.
        let Some(item) = place.item else { continue };
        let item = Item {
            module: place.module.path.clone(),
            is_type: place.module.types.contains(&item),
            name: item,
        };
        found.entry(item).or_default().insert(whole.join("::"));
    }
}
