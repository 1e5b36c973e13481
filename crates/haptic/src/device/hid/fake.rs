//! A HID device in memory for tests: it can be unplugged, and keeps what it was sent.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use crate::device::contract::DeviceError;
use crate::device::hid::port::{Connector, HidPort};

/// How it answers the request for the feature report with this id.
type Answer = Box<dyn FnMut(u8) -> Vec<u8> + Send>;

pub(crate) struct FakeState {
    pub(crate) plugged: bool,
    pub(crate) connections: usize,
    /// Reports to read, each once.
    pub(crate) input: VecDeque<Vec<u8>>,
    /// Read for ever once `input` is empty; nothing if empty itself.
    pub(crate) rest: Vec<u8>,
    pub(crate) sent: Vec<Vec<u8>>,
    pub(crate) descriptor: Vec<u8>,
    answer: Answer,
}

#[derive(Clone)]
pub(crate) struct Fake(Arc<Mutex<FakeState>>);

impl Fake {
    pub(crate) fn new(
        descriptor: Vec<u8>,
        answer: impl FnMut(u8) -> Vec<u8> + Send + 'static,
    ) -> Self {
        Self(Arc::new(Mutex::new(FakeState {
            plugged: true,
            connections: 0,
            input: VecDeque::new(),
            rest: Vec::new(),
            sent: Vec::new(),
            descriptor,
            answer: Box::new(answer),
        })))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, FakeState> {
        self.0.lock().unwrap()
    }

    pub(crate) fn connector(&self) -> Connector {
        let fake = self.clone();
        Box::new(move || {
            fake.connected()?.connections += 1;
            Ok(Box::new(fake.clone()))
        })
    }

    /// What was sent since the last call.
    pub(crate) fn take_sent(&self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.lock().sent)
    }

    fn connected(&self) -> Result<MutexGuard<'_, FakeState>, DeviceError> {
        let state = self.lock();
        if state.plugged {
            Ok(state)
        } else {
            Err(DeviceError::Disconnected)
        }
    }
}

impl HidPort for Fake {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, DeviceError> {
        let mut state = self.connected()?;
        let report = match state.input.pop_front() {
            Some(report) => report,
            None => {
                let rest = state.rest.clone();
                drop(state);
                std::thread::sleep(timeout.min(Duration::from_millis(1)));
                rest
            }
        };
        buffer[..report.len()].copy_from_slice(&report);
        Ok(report.len())
    }

    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.connected()?.sent.push(report.to_vec());
        Ok(())
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        self.write(report)
    }

    fn get_feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        let mut state = self.connected()?;
        let answer = (state.answer)(report[0]);
        report[..answer.len()].copy_from_slice(&answer);
        Ok(answer.len())
    }

    fn descriptor(&mut self) -> Result<Vec<u8>, DeviceError> {
        Ok(self.connected()?.descriptor.clone())
    }
}

/// Waits for something that happens on another thread; a slow machine only waits longer.
pub(crate) fn wait_for(mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(20), "never happened");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The bytes of a text of hexadecimal numbers; lines that begin with # are remarks.
pub(crate) fn unhex(text: &str) -> Vec<u8> {
    let lines = text.lines().filter(|l| !l.starts_with('#'));
    let numbers = lines.flat_map(str::split_whitespace);
    numbers
        .map(|n| u8::from_str_radix(n, 16).unwrap())
        .collect()
}
