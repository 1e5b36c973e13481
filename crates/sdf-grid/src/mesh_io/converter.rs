//! Programs that turn a file into one that is read here, with limits.
//!
//! A converter runs as a process of its own, because kernels hang and crash on files that people
//! have.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::mesh::error::MeshError;

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
        let no_room = |e: std::io::Error| self.failure("a temporary folder", e.to_string());
        let folder = tempfile::tempdir().map_err(no_room)?;
        let output = folder.path().join("converted");
        let said = folder.path().join("messages.txt");
        let messages = File::create(&said).map_err(no_room)?;
        let mut command = self.limited();
        arguments(&mut command, folder.path(), &output).map_err(no_room)?;
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
            .map_err(|e| self.failure("a process to run it in", e.to_string()))?;
        let patience = self.time_limit.saturating_mul(PATIENCE);
        let ended = wait(&mut child, patience).filter(|status| !out_of_time(*status));
        let Some(status) = ended else {
            let seconds = self.time_limit.as_secs_f64();
            let limit = format!("an end within {seconds} s of processor time");
            return Err(self.failure(limit, "a process that still ran: stopped"));
        };
        let text = std::fs::read(&said).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let last = |lines: usize| {
            let skipped = text.lines().count().saturating_sub(lines);
            text.lines().skip(skipped).collect::<Vec<_>>().join(" / ")
        };
        if status
            .code()
            .is_some_and(|code| NOT_INSTALLED.contains(&code))
        {
            return Ok(Err(last(1)));
        }
        match std::fs::read(&output) {
            Ok(bytes) if status.success() => Ok(Ok(bytes)),
            _ => Err(self.failure(wanted, format!("{status}, {:?}", last(3)))),
        }
    }

    /// What went wrong, as an error that names the file and the program.
    pub fn failure(&self, expected: impl Into<String>, found: impl Into<String>) -> MeshError {
        MeshError::Converter {
            path: self.file.to_owned(),
            converter: self.program.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// The shell limits itself and then becomes the program; it exits with 127 if there is none.
    fn limited(&self) -> Command {
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
