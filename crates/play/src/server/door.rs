//! The door: connections that have not shown the key yet. One thread reads them all without waiting
//! for any, so that those who say nothing, or little at a time, hold nobody up.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use crate::server::http::{self, Head, Reading};

/// Most of them at a time; when another comes the oldest goes.
const MOST: usize = 128;

/// Longest time for the whole head of a request.
const PATIENCE: Duration = Duration::from_secs(2);

/// Connections that have not shown the key yet, the oldest first.
#[derive(Default)]
pub(crate) struct Door {
    waiting: VecDeque<Stranger>,
}

struct Stranger {
    stream: TcpStream,
    since: Instant,
    said: Vec<u8>,
}

/// Someone who has said all that is listened to here.
pub(crate) struct Caller {
    pub(crate) stream: TcpStream,
    /// `None` if it was nothing that a browser says.
    pub(crate) head: Option<Head>,
}

impl Door {
    /// Another one.
    pub(crate) fn come(&mut self, stream: TcpStream, now: Instant) {
        // One that cannot be read without waiting is not read at all.
        if stream.set_nonblocking(true).is_err() {
            return;
        }
        if self.waiting.len() == MOST {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Stranger {
            stream,
            since: now,
            said: Vec::new(),
        });
    }

    /// Reads what has come. Whoever has said a head or nonsense is given back, whoever took too long
    /// or went away is forgotten.
    pub(crate) fn hear(&mut self, now: Instant) -> Vec<Caller> {
        let mut callers = Vec::new();
        for mut stranger in std::mem::take(&mut self.waiting) {
            let head = match stranger.read() {
                Reading::More if now.saturating_duration_since(stranger.since) < PATIENCE => {
                    self.waiting.push_back(stranger);
                    continue;
                }
                Reading::More | Reading::Gone => continue,
                Reading::Head(head) => Some(head),
                Reading::Nonsense => None,
            };
            let stream = stranger.stream;
            callers.push(Caller { stream, head });
        }
        callers
    }
}

impl Stranger {
    fn read(&mut self) -> Reading {
        let mut part = [0; 1024];
        loop {
            let known = self.said.len();
            match self.stream.read(&mut part) {
                Ok(0) => return Reading::Gone,
                Ok(count) => self.said.extend_from_slice(&part[..count]),
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) if e.kind() == ErrorKind::WouldBlock => return Reading::More,
                Err(_) => return Reading::Gone,
            }
            match http::read(&self.said, known) {
                Reading::More => {}
                done => return done,
            }
        }
    }
}
