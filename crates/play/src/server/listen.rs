//! Accepts connections. One thread reads the heads of all requests without waiting for any; a
//! request with the right token gets a thread of its own.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::server::broadcaster::Broadcaster;
use crate::server::http::{Head, HeadState, Reply};
use crate::server::route::{Visitor, authorize};
use crate::server::{connection, http};

/// Most connections at a time that have shown the key.
const MAX_VISITORS: usize = 48;

/// Most connections accepted between two polls: fewer than may be pending, so that each is read
/// before it has to make room.
const MAX_ACCEPTS: usize = 32;

/// Pause between two readings for new connections and what they say, or for the end.
const POLL_PAUSE: Duration = Duration::from_millis(5);

/// Polls at the end for visitors whose connections are still closing.
const GOODBYE_POLLS: u32 = 100;

/// A place of a visitor, free again when it is dropped.
struct Permit(Arc<AtomicUsize>);

impl Permit {
    /// `None` if all are taken. One thread gives them out.
    fn take(taken: &Arc<AtomicUsize>) -> Option<Self> {
        if taken.load(Ordering::Relaxed) >= MAX_VISITORS {
            return None;
        }
        taken.fetch_add(1, Ordering::Relaxed);
        Some(Self(Arc::clone(taken)))
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Takes connections until the server ends; then waits for its guests.
pub(crate) fn listen(broadcaster: &Arc<Broadcaster>, socket: &TcpListener) {
    let (mut pending_connections, taken) =
        (PendingConnections::default(), Arc::new(AtomicUsize::new(0)));
    while !broadcaster.must_quit() {
        let now = Instant::now();
        for _ in 0..MAX_ACCEPTS {
            let Ok((stream, _)) = socket.accept() else {
                break;
            };
            pending_connections.add(stream, now);
        }
        for Received { mut stream, head } in pending_connections.poll(now) {
            let admitted = match head {
                Some(head) => authorize(broadcaster, head),
                None => Err("400 Bad Request"),
            };
            match (admitted, Permit::take(&taken)) {
                (Ok(visitor), Some(permit)) => serve_visitor(broadcaster, stream, visitor, permit),
                (Ok(_), None) => refuse(broadcaster, &mut stream, "503 Service Unavailable"),
                (Err(status), _) => refuse(broadcaster, &mut stream, status),
            }
        }
        std::thread::sleep(POLL_PAUSE);
    }
    // Pages get a close frame; one that does not read is not waited for.
    for _ in 0..GOODBYE_POLLS {
        if taken.load(Ordering::Relaxed) == 0 {
            return;
        }
        std::thread::sleep(POLL_PAUSE);
    }
}

/// Serves a visitor on a thread of its own.
fn serve_visitor(
    broadcaster: &Arc<Broadcaster>,
    stream: TcpStream,
    visitor: Visitor,
    permit: Permit,
) {
    let broadcaster = Arc::clone(broadcaster);
    let thread = std::thread::Builder::new().name("play-page".into());
    let spawned = thread.spawn(move || {
        let _seat = permit;
        connection::serve(&broadcaster, stream, &visitor);
    });
    if let Err(e) = spawned {
        tracing::warn!("no thread for a page: {e}");
    }
}

/// Refuses in a word. The stream does not wait: a few hundred bytes fit what the system keeps, and
/// a client that has filled that gets no reply.
fn refuse(broadcaster: &Broadcaster, stream: &mut TcpStream, status: &'static str) {
    // A host that is not ours is not repeated.
    let policy = http::policy("localhost", broadcaster.access.embed);
    let _ = Reply::refused(status).write(&policy, stream);
}

/// Most of them at a time; when another comes the oldest goes.
const MAX_PENDING: usize = 128;

/// Longest time for the whole head of a request.
const HEAD_TIMEOUT: Duration = Duration::from_secs(2);

/// Connections that have not shown the key yet, the oldest first.
#[derive(Default)]
struct PendingConnections {
    waiting: VecDeque<Pending>,
}

struct Pending {
    stream: TcpStream,
    since: Instant,
    bytes: Vec<u8>,
}

/// Someone who has bytes all that is listened to here.
struct Received {
    stream: TcpStream,
    /// `None` if it was nothing that a browser says.
    head: Option<Head>,
}

impl PendingConnections {
    /// Adds a connection.
    fn add(&mut self, stream: TcpStream, now: Instant) {
        // One that cannot be read without waiting is not read at all.
        if stream.set_nonblocking(true).is_err() {
            return;
        }
        if self.waiting.len() == MAX_PENDING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Pending {
            stream,
            since: now,
            bytes: Vec::new(),
        });
    }

    /// Reads what has come. Returns connections with a complete or invalid head, and drops those
    /// that took too long or went away.
    fn poll(&mut self, now: Instant) -> Vec<Received> {
        let mut received = Vec::new();
        for mut pending in std::mem::take(&mut self.waiting) {
            let head = match pending.read() {
                HeadState::More if now.saturating_duration_since(pending.since) < HEAD_TIMEOUT => {
                    self.waiting.push_back(pending);
                    continue;
                }
                HeadState::More | HeadState::Gone => continue,
                HeadState::Head(head) => Some(head),
                HeadState::Invalid => None,
            };
            let stream = pending.stream;
            received.push(Received { stream, head });
        }
        received
    }
}

impl Pending {
    fn read(&mut self) -> HeadState {
        let mut part = [0; 1024];
        loop {
            let known = self.bytes.len();
            match self.stream.read(&mut part) {
                Ok(0) => return HeadState::Gone,
                Ok(count) => self.bytes.extend_from_slice(&part[..count]),
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) if e.kind() == ErrorKind::WouldBlock => return HeadState::More,
                Err(_) => return HeadState::Gone,
            }
            match http::read(&self.bytes, known) {
                HeadState::More => {}
                done => return done,
            }
        }
    }
}
