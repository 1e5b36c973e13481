//! What an interrupted command leaves behind, and the command that goes on.

use std::ffi::OsString;
use std::path::Path;

use crate::args::Command;
use crate::error::CommandError;

/// Says what is kept of an interrupted command, of these words.
pub(crate) fn interrupted(command: &Command, words: &[OsString]) -> CommandError {
    let again = |option: Option<&str>| {
        let typed = words.iter().map(|word| word.to_string_lossy());
        let mut words: Vec<String> = typed.map(Into::into).collect();
        if let Some(name) = words.first_mut() {
            *name = "pegfit".to_owned();
        }
        let option = option.filter(|option| !words.iter().any(|word| word == option));
        words.extend(option.map(str::to_owned));
        let words = words.iter().map(String::as_str);
        shlex::try_join(words)
            .ok()
            .map(|line| format!("`{line}` goes on"))
    };
    let file = |path: &Path| path.display().to_string();
    let (kept, next) = match command {
        Command::Bake(args) if is_there(&args.output) => (
            format!("the finished chunks are in {}", file(&args.output)),
            again(Some("--resume")),
        ),
        Command::Screen(args) => (
            format!(
                "the rows of finished parts, if any, are kept beside {}",
                file(&args.output)
            ),
            again(Some("--resume")),
        ),
        Command::Path(args) if args.resume.is_some() => {
            searched(args.resume.as_deref(), again(None))
        }
        Command::Disassemble(args) if args.resume.is_some() => {
            searched(args.resume.as_deref(), again(None))
        }
        Command::Assemble(args) if args.resume.is_some() => {
            searched(args.resume.as_deref(), again(None))
        }
        Command::Path(_) | Command::Disassemble(_) | Command::Assemble(_) => (
            "nothing is kept; with --resume FILE it would be".to_owned(),
            None,
        ),
        Command::Score(args) if args.output == Path::new("-") => {
            ("the rows that were printed are right".to_owned(), None)
        }
        Command::Feel(_) => ("its log and picture are whole".to_owned(), None),
        Command::Demo(args) => (
            format!("finished pictures are in {}", file(&args.out)),
            None,
        ),
        _ => ("nothing is kept".to_owned(), None),
    };
    CommandError::Stopped { kept, next }
}

/// Whether a table has been begun, or may have been: a store at a URL is not asked.
fn is_there(table: &Path) -> bool {
    table.exists() || table.to_string_lossy().contains("://")
}

/// What a search leaves that can go on.
fn searched(file: Option<&Path>, next: Option<String>) -> (String, Option<String>) {
    let file = file.unwrap_or(Path::new("")).display().to_string();
    (format!("what was tried is in {file}"), next)
}
