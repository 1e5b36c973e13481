//! Progress bars and the Ctrl-C flag, handed to the libraries as their [`Monitor`].
//! While a device is held, a second Ctrl-C waits until the device has stopped.

use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use sdf_grid::Monitor;
use sdf_grid::text::shown_lines;

use crate::error::{CommandError, Exit};

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
            wait_for_none(STOP_WAIT);
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
pub(crate) fn interrupted() -> bool {
    CANCELLED.load(Ordering::SeqCst)
}

/// Ends a command between two steps if a stop has been asked for.
///
/// # Errors
/// [`CommandError::Interrupted`] once Ctrl-C was pressed.
pub(crate) fn check_interrupt() -> Result<(), CommandError> {
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// One progress bar at a time on standard error, with rate and time left.
#[derive(Debug)]
pub(crate) struct Progress {
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
    pub(crate) fn new(quiet: bool) -> Self {
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
    pub(crate) fn finish(&self) {
        if let Ok(stage) = self.bar.lock() {
            stage.bar.finish_and_clear();
        }
    }

    /// Prints a line to standard error without tearing the bar, unless quiet.
    pub(crate) fn note(&self, line: &str) {
        if self.quiet {
            return;
        }
        if let Ok(stage) = self.bar.lock() {
            stage.bar.suspend(|| remark!("{line}"));
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
        let template = "{prefix:>24} {bar:28} {pos}/{len}{rate}{left}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            let rate = |state: &ProgressState, out: &mut dyn Write| {
                let _ = out.write_str(&rate(state.per_sec()));
            };
            let left = |state: &ProgressState, out: &mut dyn Write| {
                let _ = out.write_str(&time_left(state.fraction(), state.elapsed()));
            };
            bar.set_style(style.with_key("rate", rate).with_key("left", left));
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

/// Steps a second with two digits, or seconds a step; nothing before the first.
fn rate(per_second: f64) -> String {
    match per_second {
        r if !r.is_finite() || r <= 0.0 => String::new(),
        r if r >= 10.0 => format!("  {r:.0}/s"),
        r if r >= 1.0 => format!("  {r:.1}/s"),
        r => format!("  {:.1} s each", r.recip()),
    }
}

/// The time left if all goes on as so far on the average, rounded as it deserves; nothing while too
/// little is done to tell.
fn time_left(done: f32, elapsed: Duration) -> String {
    let done = f64::from(done);
    if !(0.02..1.0).contains(&done) || elapsed < Duration::from_secs(2) {
        return String::new();
    }
    let seconds = elapsed.as_secs_f64() * (1.0 - done) / done;
    match seconds {
        s if s < 55.0 => format!("  about {:.0} s left", (s / 5.0).ceil() * 5.0),
        s if s < 90.0 * 60.0 => format!("  about {:.0} min left", (s / 60.0).ceil()),
        s => format!("  about {:.1} h left", s / 3600.0),
    }
}

/// Devices held now.
static HELD: Mutex<u32> = Mutex::new(0);

/// Told when one is let go.
static LET_GO: Condvar = Condvar::new();

/// A device is held as long as this lives; declare it before the device, so that it goes last.
#[derive(Debug)]
#[must_use]
pub struct Hold(());

impl Hold {
    /// A device is about to be opened.
    pub fn begin() -> Self {
        *HELD.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        Self(())
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        *HELD.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        LET_GO.notify_all();
    }
}

/// Waits until no device is held, at most for `limit`; true if none is.
pub fn wait_for_none(limit: Duration) -> bool {
    let held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    let waited = LET_GO.wait_timeout_while(held, limit, |held| *held > 0);
    let (held, _) = waited.unwrap_or_else(PoisonError::into_inner);
    *held == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_times_have_the_digits_that_they_deserve() {
        let texts = [123.4, 12.34, 1.234, 0.4, 0.0].map(rate);
        assert_eq!(texts, ["  123/s", "  12/s", "  1.2/s", "  2.5 s each", ""]);
        let left = |done: f32, seconds: u64| time_left(done, Duration::from_secs(seconds));
        assert_eq!(left(0.01, 10), "");
        assert_eq!(left(0.5, 1), "");
        assert_eq!(left(0.5, 12), "  about 15 s left");
        assert_eq!(left(0.5, 100), "  about 2 min left");
        assert_eq!(left(0.1, 3600), "  about 9.0 h left");
        assert_eq!(left(1.0, 10), "");
    }

    #[test]
    fn waiting_ends_when_the_last_device_is_let_go_and_not_before() {
        let moment = Duration::from_millis(50);
        assert!(wait_for_none(Duration::ZERO));
        let (first, second) = (Hold::begin(), Hold::begin());
        assert!(!wait_for_none(moment));
        drop(first);
        assert!(!wait_for_none(moment));
        let begin = Instant::now();
        let other = std::thread::spawn(move || {
            std::thread::sleep(moment);
            drop(second);
        });
        assert!(wait_for_none(Duration::from_secs(20)));
        assert!(begin.elapsed() >= moment);
        other.join().unwrap();
    }
}
