//! Records the loop's samples while a page asks for it.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fft_correlate::Pose;
use haptic::log::{SampleWriter, write_csv};
use haptic::{RecordError, Sample, Workspace};

/// Most samples of a recording: two minutes at 1 kHz, some 50 MB.
const LONGEST: usize = 120_000;

/// Shared by the log's thread, which writes, and the pages, which start it and read it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Recorder(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    runs: bool,
    samples: Vec<Sample>,
}

impl Recorder {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts a new recording, or ends the running one.
    pub(crate) fn record(&self, on: bool) {
        let mut state = self.state();
        if on && !state.runs {
            state.samples.clear();
        }
        state.runs = on;
    }

    /// Adds a sample if it records.
    pub(crate) fn push(&self, sample: &Sample) {
        let mut state = self.state();
        if state.runs {
            state.samples.push(*sample);
            state.runs = state.samples.len() < LONGEST;
        }
    }

    /// Whether it records, and the length of the recording, seconds.
    pub(crate) fn length(&self) -> (bool, f64) {
        let state = self.state();
        let seconds = match (state.samples.first(), state.samples.last()) {
            (Some(first), Some(last)) => last.time - first.time,
            _ => 0.0,
        };
        (state.runs, seconds)
    }

    /// The recording as a CSV log, which `pegfit feel --device replay:` takes.
    pub(crate) fn csv(&self) -> std::io::Result<Vec<u8>> {
        let samples = self.state().samples.clone();
        let mut out = Vec::new();
        write_csv(&samples, &mut out)?;
        Ok(out)
    }

    /// Where the hand would have had the part in each tick.
    pub(crate) fn poses(&self, workspace: &Workspace) -> Vec<Pose> {
        let state = self.state();
        let inputs = state.samples.iter().filter_map(|s| s.input.as_ref());
        inputs
            .map(|input| workspace.part_pose(&workspace.grip_pose(&input.pose)))
            .collect()
    }
}

impl SampleWriter for Recorder {
    fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
        self.push(sample);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), RecordError> {
        Ok(())
    }

    fn path(&self) -> PathBuf {
        "recorder".into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tape_holds_what_happened_while_it_ran_and_ends_when_full() {
        let recorder = Recorder::default();
        let mut writer: Box<dyn SampleWriter> = Box::new(recorder.clone());
        let mut write = |range: std::ops::Range<u64>| {
            for tick in range {
                let time = tick as f64 * 1e-3;
                let sample = Sample {
                    tick,
                    time,
                    ..Sample::default()
                };
                writer.write(&sample).unwrap();
            }
        };
        write(0..100);
        assert_eq!(recorder.length(), (false, 0.0));
        recorder.record(true);
        write(100..351);
        recorder.record(false);
        write(351..400);
        let (runs, seconds) = recorder.length();
        assert!(!runs && (seconds - 0.25).abs() < 1e-12);
        let text = String::from_utf8(recorder.csv().unwrap()).unwrap();
        assert_eq!(text.lines().count(), 252);
        assert!(text.lines().nth(1).unwrap().starts_with("100,0.1,"));
        recorder.record(true);
        write(0..LONGEST as u64 + 5);
        let (runs, seconds) = recorder.length();
        assert!(!runs && seconds < LONGEST as f64 * 1e-3);
    }
}
