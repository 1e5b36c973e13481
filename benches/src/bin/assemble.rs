//! Assemblies from scattered parts: `assemble [--quick] [--out DIR] [--seeds A..B] [--frames A..B]
//! [--only NAME] [--limit SECONDS] [--apart] [--page PAGE.md] [FOLDER...]`.
//!
//! The generated assemblies of `pegfit_fixtures` with the sizes of `--seeds`, and those of folders
//! (parts as OBJ files in their places, `assembly.json` with unit and names). Every part is moved at
//! random (`--frames`; 0: as it lies) and the whole is put together again. A part is right if it lies
//! within 2 % of its diagonal of its place relative to the others, up to symmetry and to equal parts.
//! A search that takes longer than `--limit` (600 s) is stopped, and what it has is judged. With
//! `--apart` what was found is taken apart, as the command does. Prints a line per try; writes
//! `assemblies.csv`, a line per assembly, and with `--page` the table into a page.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pegfit_assemble::{AssemblyRequest, AssemblyResult, AssemblySearch};
use pegfit_benches::known_assemblies::{Verdict, judge, known_score, read, scattered};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome, parse_range};
use pegfit_fixtures::{KnownAssembly, known_assembly, known_assembly_names};
use sdf_grid::Monitor;

struct Wanted {
    seeds: Range<u64>,
    frames: Range<u64>,
    only: String,
    limit: Duration,
    page: Option<PathBuf>,
    request: AssemblyRequest,
}

const USAGE: &str = "usage: assemble [--quick] [--out DIR] [--seeds A..B] [--frames A..B] \
    [--only NAME] [--limit SECONDS] [--apart] [--page PAGE.md] [FOLDER...]";

/// What the tries at one assembly gave.
#[derive(Default)]
struct Tries {
    count: usize,
    right: usize,
    ambiguous: usize,
    seconds: Vec<f64>,
    pairs: usize,
    overlap: f64,
    wrong: Vec<String>,
}

fn main() -> Outcome<()> {
    let mut arguments = Arguments::parse_known()?;
    let wanted = wanted(&mut arguments)?;
    let mut table = Table::new(
        "assemblies",
        "Assemblies from scattered parts",
        &format!(
            "Every part is moved at random. Right: all parts lie within 2 % of their diagonals of \
             their places relative to each other, up to symmetry and to equal parts, and nothing \
             that does not belong there is placed. Not certain: wrong, and the result says that \
             another assembly is as good. Overlap: the largest volume that two parts share, of the \
             smallest part's. A search is stopped after {} s. Sizes of seeds {:?}, frames {:?}.",
            wanted.limit.as_secs(),
            wanted.seeds,
            wanted.frames
        ),
        &[
            "assembly",
            "parts",
            "pairs docked",
            "tries",
            "right",
            "not certain",
            "wrong",
            "seconds",
            "overlap",
            "what failed",
        ],
    );
    for known in assemblies(&wanted, &arguments)? {
        println!("\n== {}", known.name);
        let mut tries = Tries::default();
        for frame in wanted.frames.clone() {
            one(&known, frame, &wanted, &mut tries);
        }
        table.push(tries.row(&known));
        // A long run that is stopped leaves what it has.
        if let Some(page) = &wanted.page {
            arguments.write_into_page(page, "just assemblies", &[&table])?;
        }
    }
    arguments.publish(&table, None)
}

/// Stops a search at a time.
struct Deadline(Instant);

impl Monitor for Deadline {
    fn cancelled(&self) -> bool {
        Instant::now() > self.0
    }
}

/// One try.
fn one(known: &KnownAssembly, frame: u64, wanted: &Wanted, tries: &mut Tries) {
    let parts = scattered(known, frame);
    tries.count += 1;
    let search = AssemblySearch::new(parts.clone(), wanted.request.clone());
    let deadline = Deadline(Instant::now() + wanted.limit);
    let result = match search.and_then(|search| search.run(&deadline)) {
        Ok(result) => result,
        Err(error) => {
            println!("   {frame}: {error}");
            return tries.wrong.push(error.to_string());
        }
    };
    let verdict = judge(known, &parts, &result.assemblies[0]);
    println!("   {frame}: {}", line(&result, &verdict, known));
    if deadline.cancelled() && !verdict.is_right() {
        println!("   {frame}: stopped");
        tries.measure(&result, &verdict);
        return tries.wrong.push("out of time".to_owned());
    }
    tries.add(&result, verdict);
}

fn line(result: &AssemblyResult, verdict: &Verdict, known: &KnownAssembly) -> String {
    let best = &result.assemblies[0];
    let margin = result.margin.map_or("-".into(), |m| format!("{m:.2}"));
    format!(
        "{} of {} right{}, {:.1} nats, margin {margin}, {:.1} s (pairs {:.1}, beam {:.1}), overlap \
         {:.2e}{}",
        verdict.right,
        known.parts.len(),
        if verdict.is_right() {
            String::new()
        } else {
            format!(
                " (wrong: {:?}, strangers {}; where they belong {:.1} nats)",
                verdict.wrong,
                verdict.strangers,
                known_score(known),
            )
        },
        best.score,
        result.seconds,
        result.pair_seconds,
        result.beam_seconds,
        verdict.overlap,
        match &best.disassembly {
            Some(apart) => format!(", locked {}, {:.1} s", apart.locked.len(), apart.seconds),
            None => String::new(),
        },
    )
}

impl Tries {
    fn measure(&mut self, result: &AssemblyResult, verdict: &Verdict) {
        self.seconds.push(result.seconds);
        self.pairs = self.pairs.max(result.pairs.len());
        self.overlap = self.overlap.max(verdict.overlap);
    }

    fn add(&mut self, result: &AssemblyResult, verdict: Verdict) {
        self.measure(result, &verdict);
        match (verdict.is_right(), result.is_certain()) {
            (true, _) => self.right += 1,
            (false, false) => self.ambiguous += 1,
            (false, true) => {
                let placed = (verdict.strangers > 0).then(|| "a stranger".to_owned());
                self.wrong.extend(verdict.wrong.into_iter().chain(placed));
            }
        }
    }

    fn row(mut self, known: &KnownAssembly) -> Vec<String> {
        self.seconds.sort_by(f64::total_cmp);
        let median = self.seconds.get(self.seconds.len() / 2);
        self.wrong.sort();
        self.wrong.dedup();
        vec![
            known.name.clone(),
            (known.parts.len() + known.strangers.len()).to_string(),
            self.pairs.to_string(),
            self.count.to_string(),
            self.right.to_string(),
            self.ambiguous.to_string(),
            (self.count - self.right - self.ambiguous).to_string(),
            median.map_or("-".into(), |s| significant(*s, 2)),
            significant(self.overlap, 2),
            self.wrong.join(", "),
        ]
    }
}

/// What is asked for.
fn wanted(arguments: &mut Arguments) -> Outcome<Wanted> {
    let mut wanted = Wanted {
        seeds: 1..2,
        frames: if arguments.quick { 1..2 } else { 1..4 },
        only: String::new(),
        limit: Duration::from_secs(600),
        page: None,
        request: AssemblyRequest {
            path_time: Duration::ZERO,
            ..AssemblyRequest::default()
        },
    };
    let rest = &mut arguments.rest;
    while let Some(at) = rest.iter().position(|a| a.starts_with("--")) {
        let option = rest.remove(at);
        if option == "--apart" {
            wanted.request.path_time = AssemblyRequest::default().path_time;
            continue;
        }
        if at == rest.len() {
            return Err(USAGE.into());
        }
        let value = rest.remove(at);
        match option.as_str() {
            "--seeds" => wanted.seeds = parse_range(&value).ok_or(USAGE)?,
            "--frames" => wanted.frames = parse_range(&value).ok_or(USAGE)?,
            "--only" => wanted.only = value,
            "--limit" => wanted.limit = Duration::from_secs(value.parse().map_err(|_| USAGE)?),
            "--page" => wanted.page = Some(value.into()),
            _ => return Err(USAGE.into()),
        }
    }
    Ok(wanted)
}

/// The generated assemblies, and those of the folders.
fn assemblies(wanted: &Wanted, arguments: &Arguments) -> Outcome<Vec<KnownAssembly>> {
    let mut found = Vec::new();
    for seed in wanted.seeds.clone() {
        for name in known_assembly_names() {
            found.extend(known_assembly(seed, name)?);
        }
    }
    for folder in &arguments.rest {
        found.push(read(Path::new(folder))?);
    }
    found.retain(|known| known.name.contains(&wanted.only));
    Ok(found)
}
