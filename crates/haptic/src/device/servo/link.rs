//! The servo thread's end: which wrench the device gets, and what the loop gets to see.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use fft_correlate::Wrench;
use triple_buffer::{Input, Output, triple_buffer};

use crate::device::contract::DeviceError;
use crate::device::servo::turn::{Handle, Turn};

/// Silence of the loop after which the device gets no force.
const PATIENCE: Duration = Duration::from_millis(12);

/// The same for a slow loop: at most this long, and no more than twice its last pause.
const GREATEST_PATIENCE: Duration = Duration::from_millis(50);

/// Seconds in which the force rises to full strength after the device was away, had taken it away
/// by itself, or had lost the loop.
const RAMP: f64 = 0.5;

/// The newest of the device.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) handle: Option<Handle>,
    pub(super) connected: bool,
    pub(super) alive: Instant,
}

/// Shared by the loop and the servo thread.
#[derive(Debug, Default)]
pub(super) struct Signals {
    pub(super) quit: AtomicBool,
    pub(super) gone: AtomicBool,
    pub(super) stops_asked: AtomicU32,
    pub(super) stops_done: AtomicU32,
    /// Locked by the servo thread in a fault, and by whoever asks for it.
    pub(super) fault: Mutex<Option<DeviceError>>,
}

/// The loop's end.
pub(super) struct LoopEnd {
    pub(super) seen: Output<Seen>,
    pub(super) mailbox: Input<Wrench>,
    pub(super) signals: Arc<Signals>,
}

/// What the loop is doing, as far as its letters show.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Loop {
    /// Nothing since the start or a stop.
    Idle,
    /// Sends; falls silent if nothing comes for so long.
    Pushing { patience: Duration },
    /// Sent, and then no more.
    Silent,
}

/// The servo thread's end.
pub(crate) struct Link {
    seen: Input<Seen>,
    letters: Output<Wrench>,
    signals: Arc<Signals>,
    state: Loop,
    heard: Instant,
    rising: Option<Instant>,
}

impl Link {
    /// Both ends.
    pub(super) fn pair() -> (LoopEnd, Self) {
        let (seen_in, seen) = triple_buffer(&Seen {
            handle: None,
            connected: true,
            alive: Instant::now(),
        });
        let (mailbox, letters) = triple_buffer(&Wrench::ZERO);
        let signals = Arc::new(Signals::default());
        let loop_end = LoopEnd {
            seen,
            mailbox,
            signals: Arc::clone(&signals),
        };
        let link = Self {
            seen: seen_in,
            letters,
            signals,
            state: Loop::Idle,
            heard: Instant::now(),
            rising: None,
        };
        (loop_end, link)
    }

    /// Whether the device is to be let go for good. A turn after this was seen has no force.
    pub(crate) fn quit(&self) -> bool {
        self.signals.quit.load(Ordering::Acquire)
    }

    /// One exchange: hands over the wrench to push with from now on, and shows the answer. A stop
    /// counts as done when the device has taken a wrench of zero.
    pub(crate) fn turn(
        &mut self,
        exchange: impl FnOnce(&Wrench) -> Result<Turn, DeviceError>,
    ) -> Result<(), DeviceError> {
        let asked = self.signals.stops_asked.load(Ordering::Acquire);
        let stop = asked != self.signals.stops_done.load(Ordering::Acquire) || self.quit();
        let turn = exchange(&self.wrench(stop))?;
        if let Some(why) = turn.refused {
            self.rising = Some(Instant::now());
            self.remember(why);
        }
        self.seen.write(Seen {
            handle: turn.handle,
            connected: true,
            alive: Instant::now(),
        });
        self.signals.stops_done.store(asked, Ordering::Release);
        Ok(())
    }

    /// The wrench to push with now.
    fn wrench(&mut self, stop: bool) -> Wrench {
        let new = self.letters.update();
        if stop {
            self.state = Loop::Idle;
            return Wrench::ZERO;
        }
        let pause = self.heard.elapsed();
        self.state = match self.state {
            state if new => {
                self.heard = Instant::now();
                if state == Loop::Silent {
                    self.rising = Some(self.heard);
                }
                let patience = match state {
                    Loop::Idle => PATIENCE,
                    _ => (2 * pause).clamp(PATIENCE, GREATEST_PATIENCE),
                };
                Loop::Pushing { patience }
            }
            Loop::Pushing { patience } if pause > patience => Loop::Silent,
            state => state,
        };
        let wrench = *self.letters.output_buffer();
        let finite = wrench.force.is_finite() && wrench.torque.is_finite();
        match self.state {
            Loop::Pushing { .. } if finite => wrench * self.rise(),
            _ => Wrench::ZERO,
        }
    }

    /// Share of the force shown.
    fn rise(&mut self) -> f64 {
        let Some(since) = self.rising else {
            return 1.0;
        };
        let share = since.elapsed().as_secs_f64() / RAMP;
        if share >= 1.0 {
            self.rising = None;
        }
        share.min(1.0)
    }

    /// The device has failed and is closed.
    pub(super) fn lost(&mut self, fault: DeviceError) {
        self.remember(fault);
        self.state = Loop::Idle;
        self.seen.write(Seen {
            handle: None,
            connected: false,
            alive: Instant::now(),
        });
        self.signals.gone.store(true, Ordering::Release);
    }

    /// The device is open again.
    pub(super) fn back(&mut self) {
        self.rising = Some(Instant::now());
        // What was sent while it was away is old.
        self.letters.update();
        let asked = self.signals.stops_asked.load(Ordering::Acquire);
        self.signals.stops_done.store(asked, Ordering::Release);
        self.signals.gone.store(false, Ordering::Release);
    }

    fn remember(&self, fault: DeviceError) {
        *self
            .signals
            .fault
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = Some(fault);
    }
}
