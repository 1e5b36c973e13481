//! Programs that turn a file into one that is read here, with limits.
//!
//! A converter runs as a process of its own, because kernels hang and crash on files that people
//! have.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::mesh::error::MeshError;
use crate::text::quoted;

/// Exit codes that say that a converter is not installed: the shell's, and that of a script without
/// a module.
const NOT_INSTALLED: [i32; 2] = [127, 69];

/// A converter that waits for something is stopped after this many times its limit of processor
/// time, by the clock: other programs may take the processors.
const PATIENCE: u32 = 10;

/// A program that turns one file into another.
#[derive(Debug, Clone, Copy)]
pub struct Converter<'a> {
    /// The file to convert, for errors.
    pub file: &'a Path,
    /// The program: a path, or a name on the PATH.
    pub program: &'a Path,
    /// Processor time after which the program is stopped, with all that it started, in whole
    /// seconds, at least one; by the clock it may take ten times as long.
    pub time_limit: Duration,
    /// Address space that the program may use, and the most it may write to a file, bytes.
    pub memory_limit: u64,
}

impl Converter<'_> {
    /// Runs the program in a temporary folder and returns what it writes. `arguments` puts its
    /// arguments on a command, given the folder and the file to write. The outer error is a failure,
    /// the inner one says why the program is not installed: it is not found, or exits with code 69.
    ///
    /// # Errors
    /// If the program cannot be started, passes a limit, fails, or writes no file; `wanted` stands in
    /// the error for what it should have written.
    pub fn run(
        &self,
        wanted: &str,
        arguments: impl FnOnce(&mut Command, &Path, &Path) -> std::io::Result<()>,
    ) -> Result<Result<Vec<u8>, String>, MeshError> {
        const OUTPUT: &str = "converted";
        let command = |command: &mut Command, folder: &Path| {
            let output = folder.join(OUTPUT);
            arguments(command, folder, &output)
        };
        let finished = self.execute(command);
        let finished = finished.map_err(|[expected, found]| self.failure(expected, found))?;
        if finished.is_not_installed() {
            return Ok(Err(finished.last_lines(1)));
        }
        let output = finished.output(OUTPUT);
        output
            .map(Ok)
            .ok_or_else(|| self.failure(wanted, finished.describe()))
    }

    /// Runs the program in a temporary folder until it ends. `arguments` puts its arguments on a
    /// command, given the folder.
    ///
    /// # Errors
    /// If the program cannot be started or passes a limit: what was expected and what was found.
    pub(super) fn execute(
        &self,
        arguments: impl FnOnce(&mut Command, &Path) -> std::io::Result<()>,
    ) -> Result<FinishedRun, [String; 2]> {
        let no_room = |e: std::io::Error| ["a temporary folder".to_owned(), e.to_string()];
        let folder = tempfile::tempdir().map_err(no_room)?;
        let path = folder.path().join("messages.txt");
        let messages = File::create(&path).map_err(no_room)?;
        let mut command = self.limited_command();
        arguments(&mut command, folder.path()).map_err(no_room)?;
        command
            .stdin(Stdio::null())
            .stdout(messages.try_clone().map_err(no_room)?)
            .stderr(messages)
            .current_dir(folder.path());
        // A group of its own, so that what the converter starts is stopped with it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .spawn()
            .map_err(|e| ["a process to run it in".to_owned(), e.to_string()])?;
        let patience = self.time_limit.saturating_mul(PATIENCE);
        let ended = wait(&mut child, patience).filter(|status| !out_of_time(*status));
        let Some(status) = ended else {
            let seconds = self.time_limit.as_secs_f64();
            let limit = format!("an end within {seconds} s of processor time");
            return Err([limit, "a process that still ran: stopped".to_owned()]);
        };
        let messages = std::fs::read(&path).unwrap_or_default();
        Ok(FinishedRun {
            folder,
            status,
            messages: String::from_utf8_lossy(&messages).into_owned(),
        })
    }

    /// An error that names the file and the program.
    pub fn failure(&self, expected: impl Into<String>, found: impl Into<String>) -> MeshError {
        MeshError::Converter {
            path: self.file.to_owned(),
            converter: self.program.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// The shell limits itself and then becomes the program; it exits with 127 if there is none.
    fn limited_command(&self) -> Command {
        let seconds = self.time_limit.as_secs_f64().ceil().max(1.0);
        let mut command = Command::new("sh");
        command
            .arg("-c")
            .arg(
                "ulimit -v \"$1\" && ulimit -f \"$2\" && ulimit -S -t \"$3\" && shift 3 && \
                 exec \"$@\"",
            )
            .arg("sh")
            .arg((self.memory_limit / 1024).to_string())
            .arg((self.memory_limit / 512).to_string())
            .arg(format!("{seconds:.0}"))
            .arg(self.program);
        command
    }
}

/// A program that ended by itself, and the folder in which it ran, which is removed with it.
pub(super) struct FinishedRun {
    folder: tempfile::TempDir,
    pub(super) status: ExitStatus,
    /// Everything it printed.
    pub(super) messages: String,
}

impl FinishedRun {
    pub(super) fn is_not_installed(&self) -> bool {
        let code = self.status.code();
        code.is_some_and(|code| NOT_INSTALLED.contains(&code))
    }

    /// A file that the program wrote into its folder, if it succeeded.
    pub(super) fn output(&self, name: &str) -> Option<Vec<u8>> {
        let bytes = std::fs::read(self.folder.path().join(name)).ok()?;
        self.status.success().then_some(bytes)
    }

    /// The last lines that it printed.
    pub(super) fn last_lines(&self, lines: usize) -> String {
        let skipped = self.messages.lines().count().saturating_sub(lines);
        let last: Vec<&str> = self.messages.lines().skip(skipped).collect();
        last.join(" / ")
    }

    /// How it ended and the last that it printed, for errors.
    pub(super) fn describe(&self) -> String {
        format!("{}, {}", self.status, quoted(&self.last_lines(3)))
    }
}

/// Whether a process, or one that its shell waited for, was ended for taking too much processor
/// time.
#[cfg(unix)]
fn out_of_time(status: ExitStatus) -> bool {
    let signal = rustix::process::Signal::XCPU.as_raw();
    std::os::unix::process::ExitStatusExt::signal(&status) == Some(signal)
        || status.code() == Some(128 + signal)
}

#[cfg(not(unix))]
fn out_of_time(_: ExitStatus) -> bool {
    false
}

/// Waits for the child until the limit, then stops it and all it started and returns `None`.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if start.elapsed() < limit => std::thread::sleep(Duration::from_millis(10)),
            _ => {
                stop(child);
                // It may have ended in between; either way it must be reaped.
                let _ = child.wait();
                return None;
            }
        }
    }
}

#[cfg(unix)]
fn stop(child: &mut Child) {
    let group = rustix::process::Pid::from_child(child);
    if rustix::process::kill_process_group(group, rustix::process::Signal::KILL).is_err() {
        let _ = child.kill();
    }
}

#[cfg(not(unix))]
fn stop(child: &mut Child) {
    let _ = child.kill();
}
