//! What the page consists of.

/// A part of the page: one program, run once or several times.
pub(crate) struct Section {
    /// For `only=`, folders and picture names.
    pub(crate) key: &'static str,
    pub(crate) title: &'static str,
    pub(crate) about: &'static str,
    pub(crate) program: &'static str,
    /// Arguments of each run.
    pub(crate) quick: &'static [&'static [&'static str]],
    pub(crate) full: &'static [&'static [&'static str]],
    /// What stands before the folder of real parts, if the program takes it.
    pub(crate) parts: Option<&'static str>,
    /// Left out where there is no such folder.
    pub(crate) needs_parts: bool,
    /// The page in `docs` that it has to itself.
    pub(crate) own_page: Option<&'static str>,
}

pub(crate) const SECTIONS: [Section; 11] = [
    Section {
        key: "field",
        title: "Density fields",
        about: "What a field costs and how far it is from the sum over all triangles; how it is \
            computed stands in [Density fields](fields.md).",
        program: "field",
        quick: &[&["--quick", "only=10k"]],
        full: &[&[]],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "solids",
        title: "Density fields of random solids",
        about: "Whether tolerances are kept on shapes that nobody chose.",
        program: "field",
        quick: &[&["--quick", "solids"]],
        full: &[&["solids"]],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "parts",
        title: "Density fields of real parts",
        about: "Whether tolerances are kept on the IndustReal meshes.",
        program: "field",
        quick: &[&["--quick", "only=industreal"]],
        full: &[&["only=industreal"]],
        parts: Some(""),
        needs_parts: true,
        own_page: None,
    },
    Section {
        key: "correlate",
        title: "Correlation",
        about: "What the scores of one rotation at all displacements cost; the stages are \
            explained in [Correlation](correlation.md).",
        program: "correlate",
        quick: &[&["--quick"]],
        full: &[&[]],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "contact",
        title: "Where parts touch",
        about: "Energies and wrenches at random poses and in contact, of parts as they are, shifted \
            by fractions of a cell, and turned; cell averages beside smoothed densities with their \
            sum over both surfaces, all against a reference that knows no lattice; and the same \
            solids in many triangles.",
        program: "contact",
        quick: &[&[], CUT],
        full: &[&[], CUT],
        parts: None,
        needs_parts: false,
        own_page: Some("contact-measured.md"),
    },
    Section {
        key: "pareto",
        title: "The whole way to a wrench",
        about: "Error of the wrench against what it costs, over lattice spacing, sampling, \
            rotation step and numbers of tables and number of points of direct evaluation.",
        program: "pareto",
        quick: &[&["--quick"]],
        full: &[
            &[],
            &["turned"],
            &["clearance=0.3"],
            &["turned", "clearance=0.3"],
        ],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "docking",
        title: "Docking",
        about: "Whether docking finds where parts belong however both lie in their frames, which \
            joint they have there, and how long it takes; [Docking](docking.md) explains the \
            stages.",
        program: "docking",
        quick: &[
            &["--quick", "--kinds", "shifted,both", "--seeds", "0..4"],
            &["--quick", "--kinds", "both", "--joints", "1..2"],
        ],
        full: &[
            &["--starts", "50", "--seeds", "0..50"],
            &[
                "--starts",
                "3",
                "--kinds",
                "in place,both",
                "--joints",
                "1..3",
            ],
        ],
        parts: Some(""),
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "paths",
        title: "Insertion paths",
        about: "How often the path is found, and that there is none where there is none; explained \
            in [Insertion paths](path.md).",
        program: "path",
        quick: &[&["--quick", "--frames", "1", "--only", "peg"]],
        full: &[&["--frames", "20"]],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "query",
        title: "Queries",
        about: "Energy and wrench at a pose, from tables and by direct evaluation.",
        program: "query",
        quick: &[&["--quick"]],
        full: &[&[]],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "loop",
        title: "The haptic loop",
        about: "What a tick costs beside the field, explained in [The haptic loop](haptics.md).",
        program: "runtime",
        quick: &[&["--quick"]],
        full: &[&[]],
        parts: None,
        needs_parts: false,
        own_page: None,
    },
    Section {
        key: "chain",
        title: "The whole chain on real parts",
        about: "Energies, docking and the snap test on IndustReal pegs in their trays.",
        program: "real-parts",
        quick: &[&["--quick"]],
        full: &[&[]],
        parts: Some(""),
        needs_parts: true,
        own_page: None,
    },
];

/// Finely cut parts, of `contact`.
const CUT: &[&str] = &[
    "clearance=0.1",
    "spacing=0.83",
    "triangles=10000",
    "triangles=100000",
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    #[test]
    fn sections_have_keys_of_their_own_and_programs_that_exist() {
        let keys: BTreeSet<_> = SECTIONS.iter().map(|s| s.key).collect();
        assert_eq!(keys.len(), SECTIONS.len());
        let bins = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/bin");
        for section in &SECTIONS {
            let file = bins.join(format!("{}.rs", section.program));
            let folder = bins.join(section.program).join("main.rs");
            assert!(file.exists() || folder.exists(), "{}", section.program);
        }
    }
}
