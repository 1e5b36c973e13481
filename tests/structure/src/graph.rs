//! Circles of a directed graph.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// For each file the files that it depends on, and the names by which it does.
pub type Graph = BTreeMap<PathBuf, BTreeMap<PathBuf, BTreeSet<String>>>;

/// Sets of more than one file, each of which leads to every other one of its set.
pub fn circles(graph: &Graph) -> Vec<Vec<PathBuf>> {
    let reach: BTreeMap<&PathBuf, BTreeSet<&PathBuf>> = graph
        .keys()
        .map(|from| (from, reachable(graph, from)))
        .collect();
    let mut found: BTreeSet<Vec<PathBuf>> = BTreeSet::new();
    for (from, to) in &reach {
        let circle: Vec<PathBuf> = to
            .iter()
            .filter(|other| reach.get(**other).is_some_and(|back| back.contains(*from)))
            .map(|&file| file.clone())
            .collect();
        if circle.len() > 1 {
            found.insert(circle);
        }
    }
    found.into_iter().collect()
}

fn reachable<'a>(graph: &'a Graph, from: &'a PathBuf) -> BTreeSet<&'a PathBuf> {
    let mut seen = BTreeSet::new();
    let mut open = vec![from];
    while let Some(file) = open.pop() {
        for next in graph.get(file).into_iter().flat_map(BTreeMap::keys) {
            if seen.insert(next) {
                open.push(next);
            }
        }
    }
    seen
}
