//! A connection that showed the key: a request and its reply, or a page that watches and perhaps
//! holds the hand.

use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::frame::coding::CloseCode;

use crate::protocol::request::Request;
use crate::server::broadcaster::Broadcaster;
use crate::server::http;
use crate::server::route::{Visitor, reply};
use crate::server::websocket::{CloseReason, NOT_UNDERSTOOD, PageSocket};

/// Time between two frames.
const FRAME_TIME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// Longest wait for a page to take what it is sent.
const PATIENCE: Duration = Duration::from_secs(2);

/// Serves one connection until it ends.
pub(crate) fn serve(broadcaster: &Arc<Broadcaster>, mut stream: TcpStream, visitor: &Visitor) {
    // A reply that cannot be sent has nobody to read it.
    let _ = answer(broadcaster, &mut stream, visitor);
}

fn answer(
    broadcaster: &Arc<Broadcaster>,
    stream: &mut TcpStream,
    visitor: &Visitor,
) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(key) = &visitor.socket_key else {
        let policy = http::policy(&visitor.host, broadcaster.access.embed);
        return reply(broadcaster, &visitor.name).write(&policy, stream);
    };
    let accept = derive_accept_key(key.as_bytes());
    write!(
        stream,
        "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\n\
         Upgrade: websocket\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    )?;
    serve_page(broadcaster, stream);
    Ok(())
}

/// A page until it goes, or is shown the door.
fn serve_page(broadcaster: &Arc<Broadcaster>, stream: &mut TcpStream) {
    let mut page = Page {
        broadcaster,
        number: broadcaster.add_page(),
        socket: PageSocket::new(stream),
        sent: [0; 2],
    };
    let ended = page.run();
    // First of all the hand lets go.
    broadcaster.remove_page(page.number);
    if let Err(CloseReason::Dismissed(code, reason)) = ended {
        page.socket.dismiss(code, reason);
    }
}

struct Page<'s> {
    broadcaster: &'s Arc<Broadcaster>,
    number: u64,
    socket: PageSocket<'s>,
    /// Numbers of the announcements that it was sent.
    sent: [u64; 2],
}

impl Page<'_> {
    fn run(&mut self) -> Result<(), CloseReason> {
        self.socket.text(self.broadcaster.greeting())?;
        let mut due = Instant::now();
        while !self.broadcaster.must_quit() {
            let now = Instant::now();
            if now >= due {
                self.send_updates()?;
                // A page that was slow gets the next frame at its time, not all that it missed.
                due = (due + FRAME_TIME).max(now);
            }
            let wait = due.saturating_duration_since(Instant::now());
            if let Some(message) = self.socket.read(wait.max(Duration::from_millis(1)))? {
                self.handle(&message)?;
            }
        }
        Err(CloseReason::Dismissed(CloseCode::Away, "the program ends"))
    }

    /// Sends announcements, then a frame.
    fn send_updates(&mut self) -> Result<(), CloseReason> {
        if self.broadcaster.announcement_numbers() != self.sent {
            let announcements = self.broadcaster.announcements();
            for (sent, announcements) in self.sent.iter_mut().zip(announcements) {
                if *sent != announcements.number {
                    *sent = announcements.number;
                    self.socket.text(announcements.text)?;
                }
            }
        }
        match self.broadcaster.frame(self.number) {
            Some(frame) => self.socket.binary(frame.bytes().to_vec()),
            None => Ok(()),
        }
    }

    fn handle(&self, message: &[u8]) -> Result<(), CloseReason> {
        let request = Request::read(message).ok_or(NOT_UNDERSTOOD)?;
        self.broadcaster.handle(self.number, &request);
        Ok(())
    }
}
