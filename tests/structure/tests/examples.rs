//! Every type at the root of a library has an example, or names an item that has one.

use std::path::Path;

use pegfit_structure::{public_paths, read_crate};

const LIBRARIES: &str = "sdf-grid fft-correlate haptic scene path assemble";

/// Errors need none: users print them.
fn is_error(name: &str) -> bool {
    name.ends_with("Error") || name == "Refusal"
}

/// The lines directly above a public item; for a module, the first ones of its file.
fn documentation<'a>(text: &'a str, name: &str) -> &'a str {
    let kinds = ["struct", "enum", "trait", "type", "fn"];
    let defined = kinds.iter().find_map(|kind| {
        let head = format!("\npub {kind} {name}");
        let longer = |at: usize| text[at + head.len()..].starts_with(char::is_alphanumeric);
        let mut places = text.match_indices(&head).map(|(at, _)| at);
        places.find(|&at| !longer(at))
    });
    match defined {
        Some(at) => text[..at].rsplit("\n\n").next().unwrap_or_default(),
        None => text.split("\n\n").next().unwrap_or_default(),
    }
}

/// Whether code in it is compiled: fences come in pairs, and the first may name a language.
fn has_example(documentation: &str) -> bool {
    let fences = documentation.lines().filter(|line| line.contains("```"));
    let mut opening = fences.step_by(2);
    opening.any(|line| line.ends_with("```") || line.ends_with("```no_run"))
}

/// The item whose example it names.
fn named(documentation: &str) -> Option<&str> {
    let (_, link) = documentation.split_once("example of [`")?;
    link.split('`').next()?.rsplit("::").next()
}

#[test]
fn types_have_examples() {
    for library in LIBRARIES.split(' ') {
        let source = Path::new("../../crates").join(library).join("src");
        let modules = read_crate(&source.join("lib.rs")).unwrap();
        let items = public_paths(&modules);
        let of = |module: &[String], name: &str| {
            let file = &modules.iter().find(|m| m.path == module)?.file;
            let text = std::fs::read_to_string(source.join(file)).ok()?;
            Some(documentation(&text, name).to_owned())
        };
        let shows = |name: &str| {
            let item = items.keys().find(|item| item.name == name);
            let module = item.map_or(vec![name.to_owned()], |item| item.module.clone());
            of(&module, name).is_some_and(|text| has_example(&text))
        };
        let is_missing = |module: &[String], name: &str| {
            let text = of(module, name).unwrap();
            !is_error(name) && !has_example(&text) && !named(&text).is_some_and(shows)
        };
        let at_root = items.iter().filter(|(item, at)| at.contains(&item.name));
        let types = at_root.map(|(item, _)| item).filter(|item| item.is_type);
        let missing: Vec<_> = types.filter(|i| is_missing(&i.module, &i.name)).collect();
        assert!(missing.is_empty(), "{library}: {missing:#?}");
    }
}

#[test]
fn an_example_is_code_that_is_compiled() {
    let text = "//! M.\n\n/// ```toml\n/// ```\n#[derive(Debug)]\npub struct A;\n\n\
                /// The example of [`crate::C`].\npub enum B {}\n\n/// ```\n/// ```\npub fn c() {}";
    let [a, b, c] = ["A", "B", "c"].map(|name| documentation(text, name));
    assert_eq!([a, b, c].map(has_example), [false, false, true]);
    assert_eq!([a, b, c].map(named), [None, Some("C"), None]);
}
