//! Progress bars and the Ctrl-C flag, handed to the libraries as their [`Monitor`].

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sdf_grid::Monitor;
use sdf_grid::text::shown_lines;

use crate::error::CommandError;
use crate::exit::Exit;
use crate::terminal::hold;

/// Set by the first Ctrl-C; every long computation looks at it between units of work.
static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Work shorter than this shows no bar.
const QUIET_TIME: Duration = Duration::from_millis(700);

/// Longest wait of a second Ctrl-C for a held device to be stopped. The loop ends within a tick, a
/// device confirms within a fifth of a second, and one that the loop has left alone stops by itself.
const STOP_WAIT: Duration = Duration::from_secs(3);

/// Makes Ctrl-C and termination signals ask for a clean stop; a second one ends the process, as soon
/// as no device is held.
pub fn watch_for_interrupts() {
    let handler = || {
        if CANCELLED.swap(true, Ordering::SeqCst) {
            hold::wait_for_none(STOP_WAIT);
            std::process::exit(Exit::Interrupted as i32);
        }
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        tracing::warn!("Ctrl-C will stop at once, not cleanly: {error}");
    }
}

/// The flag itself, for loops that watch one.
pub fn cancel_flag() -> &'static AtomicBool {
    &CANCELLED
}

/// True once a stop has been asked for.
pub fn interrupted() -> bool {
    CANCELLED.load(Ordering::SeqCst)
}

/// Ends a command between two steps if a stop has been asked for.
///
/// # Errors
/// [`CommandError::Interrupted`] once Ctrl-C was pressed.
pub fn check_interrupt() -> Result<(), CommandError> {
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// One progress bar at a time on standard error, with rate and time left.
#[derive(Debug)]
pub struct Progress {
    quiet: bool,
    bar: Mutex<Stage>,
}

#[derive(Debug)]
struct Stage {
    bar: ProgressBar,
    began: Instant,
    shown: bool,
}

impl Progress {
    /// A reporter; `quiet` hides it but still listens for Ctrl-C.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: Mutex::new(Stage {
                bar: ProgressBar::hidden(),
                began: Instant::now(),
                shown: false,
            }),
        }
    }

    /// Removes the bar from the terminal.
    pub fn finish(&self) {
        if let Ok(stage) = self.bar.lock() {
            stage.bar.finish_and_clear();
        }
    }

    /// Prints a line to standard error without tearing the bar, unless quiet.
    pub fn note(&self, line: &str) {
        if self.quiet {
            return;
        }
        if let Ok(stage) = self.bar.lock() {
            stage.bar.suspend(|| crate::remark!("{line}"));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Monitor for Progress {
    fn begin(&self, stage: &str, total: u64) {
        let Ok(mut current) = self.bar.lock() else {
            return;
        };
        current.bar.finish_and_clear();
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
        let template = "{prefix:>24} {bar:28} {pos}/{len}  {per_sec}  {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_prefix(shown_lines(stage).into_owned());
        *current = Stage {
            bar,
            began: Instant::now(),
            shown: false,
        };
    }

    fn advance(&self, steps: u64) {
        let Ok(mut stage) = self.bar.lock() else {
            return;
        };
        if !self.quiet && !stage.shown && stage.began.elapsed() > QUIET_TIME {
            stage
                .bar
                .set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
            stage.shown = true;
        }
        stage.bar.inc(steps);
    }

    fn cancelled(&self) -> bool {
        interrupted()
    }
}
