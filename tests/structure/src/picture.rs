//! The folders of crates and what uses what, as a Mermaid flow chart.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::graph::Graph;

/// A flow chart of crates, each with its name, the crates it uses and the graph of its folders.
/// Arrows lead from what uses to what is used; those that others imply are left out.
pub fn flow_chart(crates: &[(&str, &[&str], Graph)]) -> String {
    let mut text = "```mermaid\nflowchart TD\n".to_owned();
    for (name, _, folders) in crates {
        let arrows = plain(folders);
        writeln!(text, "  subgraph {}[{name}]", id(name)).expect("text grows");
        let alone = arrows.iter().filter(|(_, to)| to.is_empty());
        let used: BTreeSet<&String> = arrows.values().flatten().collect();
        for (folder, _) in alone.filter(|(folder, _)| !used.contains(folder)) {
            writeln!(text, "    {}", node(name, folder)).expect("text grows");
        }
        for (from, to) in &arrows {
            for to in to {
                let arrow = format!("{} --> {}", node(name, from), node(name, to));
                writeln!(text, "    {arrow}").expect("text grows");
            }
        }
        text += "  end\n";
    }
    let names = crates.iter().map(|(name, uses, _)| {
        let uses = uses.iter().map(|u| (*u).to_owned()).collect();
        ((*name).to_owned(), uses)
    });
    for (from, to) in without_implied(&names.collect()) {
        for to in to {
            writeln!(text, "  {} ==> {}", id(&from), id(&to)).expect("text grows");
        }
    }
    text + "```\n"
}

type Arrows = BTreeMap<String, BTreeSet<String>>;

/// The arrows of a graph between names, without those that others imply; the crate's own file,
/// which only declares the others, left out.
fn plain(graph: &Graph) -> Arrows {
    let name = |path: &std::path::Path| path.display().to_string();
    let shown = |name: &String| name != "lib" && name != "main";
    let mut arrows = Arrows::new();
    for (from, to) in graph {
        let from = name(from);
        let to: BTreeSet<String> = to.keys().map(|t| name(t)).filter(shown).collect();
        for used in to.iter().filter(|_| shown(&from)) {
            arrows.entry(used.clone()).or_default();
        }
        if shown(&from) {
            arrows.entry(from).or_default().extend(to);
        }
    }
    without_implied(&arrows)
}

/// Arrows for which no other way leads to the same end.
fn without_implied(arrows: &Arrows) -> Arrows {
    let further = |from: &String| {
        let mut seen = BTreeSet::new();
        let mut open: Vec<&String> = arrows.get(from).into_iter().flatten().collect();
        while let Some(next) = open.pop() {
            if seen.insert(next.clone()) {
                open.extend(arrows.get(next).into_iter().flatten());
            }
        }
        seen
    };
    let kept = |to: &BTreeSet<String>| {
        let implied: BTreeSet<String> = to.iter().flat_map(&further).collect();
        to.difference(&implied).cloned().collect()
    };
    arrows
        .iter()
        .map(|(from, to)| (from.clone(), kept(to)))
        .collect()
}

fn node(krate: &str, folder: &str) -> String {
    format!("{}_{folder}[{folder}]", id(krate))
}

/// A name without what Mermaid might take for an arrow.
fn id(name: &str) -> String {
    name.replace('-', "_")
}
