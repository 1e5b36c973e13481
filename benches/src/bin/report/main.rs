//! Runs the other programs of this crate and writes `docs/report.md` with their tables and charts:
//! `report [full] [fftw] [only=SECTION]... [parts=DIR] [page=FILE] [--out DIR]`.
//!
//! `full`: the sizes and repetitions that count; without it, minutes instead of hours. `fftw`: FFTW
//! beside the correlator. `only`: sections by their key; the page then holds no others and is
//! `out/report.md` unless `page` says where. A section that has a page to itself is on no other unless
//! it is asked for, and alone is written there. `parts`: a folder with the IndustReal meshes, for the
//! sections about real parts. The other programs must have
//! been built beside this one (`just report` does). What they write goes to DIR (`out/report`), a
//! folder for each section.

mod machine;
mod sections;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use pegfit_benches::Outcome;
use pegfit_benches::table::wrapped;

use sections::{SECTIONS, Section};

/// What this run was asked for.
struct Options {
    words: Vec<String>,
    full: bool,
    fftw: bool,
    only: Vec<String>,
    parts: Option<PathBuf>,
    /// Where the page goes; charts go to the folder `figures` beside it.
    page: PathBuf,
    out: PathBuf,
}

impl Options {
    fn parse() -> Outcome<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let words: Vec<String> = std::env::args().skip(1).collect();
        let mut options = Self {
            words: words.clone(),
            full: false,
            fftw: false,
            only: Vec::new(),
            parts: None,
            page: PathBuf::new(),
            out: root.join("out/report"),
        };
        let mut words = words.iter();
        while let Some(word) = words.next() {
            match (word.as_str(), word.split_once('=')) {
                ("full", _) => options.full = true,
                ("fftw", _) => options.fftw = true,
                ("--out", _) => options.out = words.next().ok_or("--out needs a folder")?.into(),
                (_, Some(("only", key))) => options.only.push(key.into()),
                (_, Some(("parts", folder))) => options.parts = Some(fs::canonicalize(folder)?),
                (_, Some(("page", file))) => options.page = file.into(),
                _ => return Err(format!("unknown word {word:?}; see the program's source").into()),
            }
        }
        if options.page.as_os_str().is_empty() {
            options.page = root.join(options.default_page());
        }
        let keys = SECTIONS.map(|s| s.key);
        match options.only.iter().find(|k| !keys.contains(&k.as_str())) {
            Some(key) => Err(format!("no section {key:?}; known: {}", keys.join(", ")).into()),
            None => Ok(options),
        }
    }

    /// Of few sections one that does not replace the page that others refer to.
    fn default_page(&self) -> String {
        match (self.only.as_slice(), self.alone()) {
            ([], _) => "docs/report.md".into(),
            (_, Some((_, page))) => format!("docs/{page}"),
            _ => "out/report.md".into(),
        }
    }

    /// The section with a page to itself, if it alone is asked for.
    fn alone(&self) -> Option<(&'static Section, &'static str)> {
        let [key] = self.only.as_slice() else {
            return None;
        };
        with_own_pages().find(|(s, _)| s.key == key)
    }

    fn wants(&self, section: &Section) -> bool {
        self.asks(section) && (!section.needs_parts || self.parts.is_some())
    }

    /// Whether a section is on the page where there are real parts.
    fn asks(&self, section: &Section) -> bool {
        match self.only.as_slice() {
            [] => section.own_page.is_none(),
            only => only.iter().any(|k| k == section.key),
        }
    }
}

/// The title of a section's own page.
fn own_title(section: &Section) -> String {
    format!("Measurements: {}", section.title.to_lowercase())
}

/// Sections that have pages to themselves, and these.
fn with_own_pages() -> impl Iterator<Item = (&'static Section, &'static str)> {
    let own = |s: &'static Section| s.own_page.map(|page| (s, page));
    SECTIONS.iter().filter_map(own)
}

fn main() -> Outcome<()> {
    let options = Options::parse()?;
    let folder = options.page.parent().unwrap_or(Path::new("."));
    let figures = folder.join("figures");
    fs::create_dir_all(&figures)?;
    let began = Instant::now();
    let mut parts = String::new();
    let mut failed = Vec::new();
    let wanted = SECTIONS.iter().filter(|s| options.wants(s));
    old_pictures(&figures, &options)?
        .iter()
        .try_for_each(fs::remove_file)?;
    for section in wanted {
        eprintln!("== {}", section.title);
        match measured(section, &options, &figures) {
            Ok(part) => parts += &part,
            Err(error) => {
                eprintln!("{}: {error}", section.key);
                let reason = wrapped(&format!("Failed: {error}"));
                let _ = write!(parts, "## {}\n\n{reason}\n\n", section.title);
                failed.push(section.key);
            }
        }
    }
    let page = heading(&options, began.elapsed().as_secs_f64()) + &parts;
    fs::write(&options.page, page.trim_end().to_owned() + "\n")?;
    println!("wrote {}", options.page.display());
    match failed.as_slice() {
        [] => Ok(()),
        _ => Err(format!("sections that failed: {}", failed.join(", ")).into()),
    }
}

/// Charts that an earlier page had of the sections asked for.
fn old_pictures(figures: &Path, options: &Options) -> Outcome<Vec<PathBuf>> {
    let mut found = Vec::new();
    let asked = SECTIONS.iter().filter(|s| options.asks(s));
    let starts: Vec<String> = asked.map(|s| format!("report-{}-", s.key)).collect();
    for entry in fs::read_dir(figures)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if starts.iter().any(|start| name.starts_with(start.as_str())) {
            found.push(path);
        }
    }
    Ok(found)
}

/// The page's head: what made it, and on what.
fn heading(options: &Options, seconds: f64) -> String {
    let told = options.words.iter().map(|word| match word.split_once('=') {
        Some(("parts", _)) => "parts=PARTS_DIR",
        _ => word,
    });
    let command = format!("just report {}", told.collect::<Vec<_>>().join(" "));
    let kind = match options.full {
        true => "a full run",
        false => "a quick run (small sizes, few repetitions: for orders of magnitude)",
    };
    let about = format!(
        "Times and errors, measured and written by `{}`, {kind}. No number on this page is \
         typed by hand. Errors are defined in [Conventions](conventions.md#errors); what they mean \
         for a user stands in [Accuracy](accuracy.md). Times are of the machine below with \
         whatever else it was doing.",
        command.trim_end()
    );
    let title = match options.alone() {
        Some((section, _)) => own_title(section),
        None => "Measurements".to_owned(),
    };
    let mut page = format!("# {title}\n\n{}\n\n", wrapped(&about));
    for (section, file) in with_own_pages().filter(|_| options.only.is_empty()) {
        let title = own_title(section);
        let _ = write!(page, "{}: [{title}]({file}).\n\n", section.title);
    }
    page += "| | |\n|---|---|\n";
    for (what, value) in machine::facts() {
        let _ = writeln!(page, "| {what} | {value} |");
    }
    let _ = write!(page, "| whole run | {:.1} minutes |\n\n", seconds / 60.0);
    page
}

/// Runs a section's program and returns its part of the page; its charts are copied to `figures`.
fn measured(section: &Section, options: &Options, figures: &Path) -> Outcome<String> {
    let mut page = format!("## {}\n\n{}\n\n", section.title, wrapped(section.about));
    let steps = if options.full {
        section.full
    } else {
        section.quick
    };
    for (step, words) in steps.iter().enumerate() {
        let out = options.out.join(format!("{}-{step}", section.key));
        fs::create_dir_all(&out)?;
        let mut words: Vec<&str> = words.to_vec();
        if options.fftw && section.program == "correlate" {
            words.push("fftw");
        }
        let shown = [section.program].into_iter().chain(words.iter().copied());
        let mut shown = shown.collect::<Vec<_>>().join(" ");
        let program = std::env::current_exe()?.with_file_name(section.program);
        let mut command = Command::new(&program);
        command.args(&words).arg("--out").arg(&out);
        if let (Some(folder), Some(prefix)) = (&options.parts, section.parts) {
            let word = format!("{prefix}{}", folder.display());
            command.arg(word);
            let _ = write!(shown, " {prefix}PARTS_DIR");
        }
        let began = Instant::now();
        let status = command.status().map_err(|e| {
            format!(
                "{}: {e}; build it with `cargo build --release -p pegfit-benches`",
                program.display()
            )
        })?;
        if !status.success() {
            return Err(format!("`{shown}` ended with {status}").into());
        }
        let part = fs::read_to_string(out.join(format!("{}.md", section.program)))?;
        page += &with_pictures(
            part,
            &out,
            &format!("report-{}-{step}", section.key),
            figures,
        )?;
        let took = format!("By `{shown}`, in {:.0} s.", began.elapsed().as_secs_f64());
        let _ = write!(page, "{}\n\n", wrapped(&took));
    }
    Ok(page)
}

/// A part of the page with its charts copied to `figures` under names that begin with `prefix`.
fn with_pictures(mut part: String, out: &Path, prefix: &str, figures: &Path) -> Outcome<String> {
    for entry in fs::read_dir(out)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        let link = format!("]({name})");
        if name.ends_with(".png") && part.contains(&link) {
            let copy = format!("{prefix}-{name}");
            fs::copy(out.join(&name), figures.join(&copy))?;
            part = part.replace(&link, &format!("](figures/{copy})"));
        }
    }
    Ok(part)
}
