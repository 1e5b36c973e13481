//! Listening: strangers wait at the door, whoever shows the key gets a thread.

use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::server::connection;
use crate::server::door::{Caller, Door};
use crate::server::http::{self, Reply};
use crate::server::hub::Hub;
use crate::server::route::{Guest, admit};

/// Most connections at a time that have shown the key.
const MOST_GUESTS: usize = 48;

/// Most connections taken between two looks at what they say: fewer than wait at the door, so that
/// each is listened to before it has to make room.
const MOST_COMING: usize = 32;

/// Pause between two looks for new connections and what they say, or for the end.
const LOOK: Duration = Duration::from_millis(5);

/// Looks at the end for guests that are still being told goodbye.
const FAREWELLS: u32 = 100;

/// A place of a guest, free again when it is dropped.
struct Seat(Arc<AtomicUsize>);

impl Seat {
    /// `None` if all are taken. One thread gives them out.
    fn take(taken: &Arc<AtomicUsize>) -> Option<Self> {
        if taken.load(Ordering::Relaxed) >= MOST_GUESTS {
            return None;
        }
        taken.fetch_add(1, Ordering::Relaxed);
        Some(Self(Arc::clone(taken)))
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Takes connections until the server ends; then waits for its guests.
pub(crate) fn listen(hub: &Arc<Hub>, socket: &TcpListener) {
    let (mut door, taken) = (Door::default(), Arc::new(AtomicUsize::new(0)));
    while !hub.quits() {
        let now = Instant::now();
        for _ in 0..MOST_COMING {
            let Ok((stream, _)) = socket.accept() else {
                break;
            };
            door.come(stream, now);
        }
        for Caller { mut stream, head } in door.hear(now) {
            let admitted = match head {
                Some(head) => admit(hub, head),
                None => Err("400 Bad Request"),
            };
            match (admitted, Seat::take(&taken)) {
                (Ok(guest), Some(seat)) => welcome(hub, stream, guest, seat),
                (Ok(_), None) => refuse(hub, &mut stream, "503 Service Unavailable"),
                (Err(status), _) => refuse(hub, &mut stream, status),
            }
        }
        std::thread::sleep(LOOK);
    }
    // Pages are told goodbye; one that does not listen is not waited for.
    for _ in 0..FAREWELLS {
        if taken.load(Ordering::Relaxed) == 0 {
            return;
        }
        std::thread::sleep(LOOK);
    }
}

/// Serves a guest on a thread of its own.
fn welcome(hub: &Arc<Hub>, stream: TcpStream, guest: Guest, seat: Seat) {
    let hub = Arc::clone(hub);
    let thread = std::thread::Builder::new().name("play-page".into());
    let spawned = thread.spawn(move || {
        let _seat = seat;
        connection::serve(&hub, stream, &guest);
    });
    if let Err(e) = spawned {
        tracing::warn!("no thread for a page: {e}");
    }
}

/// Refuses in a word. The stream does not wait: a few hundred bytes fit what the system keeps, and
/// whoever has filled that is not told.
fn refuse(hub: &Hub, stream: &mut TcpStream, status: &'static str) {
    // A host that is not ours is not repeated.
    let policy = http::policy("localhost", hub.access.embed);
    let _ = Reply::refused(status).write(&policy, stream);
}
