//! A connection that showed the key: a request and its reply, or a page that watches and perhaps
//! holds the hand.

use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::frame::coding::CloseCode;

use crate::server::frames::{Ended, Frames, NOT_UNDERSTOOD};
use crate::server::http;
use crate::server::hub::Hub;
use crate::server::route::{Guest, reply};
use crate::wire::request::Request;

/// Time between two frames.
const FRAME_TIME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// Longest wait for a page to take what it is sent.
const PATIENCE: Duration = Duration::from_secs(2);

/// Serves one connection until it ends.
pub(crate) fn serve(hub: &Arc<Hub>, mut stream: TcpStream, guest: &Guest) {
    // A reply that cannot be sent has nobody to read it.
    let _ = answer(hub, &mut stream, guest);
}

fn answer(hub: &Arc<Hub>, stream: &mut TcpStream, guest: &Guest) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(key) = &guest.socket_key else {
        let policy = http::policy(&guest.host, hub.access.embed);
        return reply(hub, &guest.name).write(&policy, stream);
    };
    let accept = derive_accept_key(key.as_bytes());
    write!(
        stream,
        "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\n\
         Upgrade: websocket\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    )?;
    watch(hub, stream);
    Ok(())
}

/// A page until it goes, or is shown the door.
fn watch(hub: &Arc<Hub>, stream: &mut TcpStream) {
    let mut page = Page {
        hub,
        number: hub.enter(),
        frames: Frames::new(stream),
        told: [0; 2],
    };
    let ended = page.run();
    // First of all the hand lets go.
    hub.leave(page.number);
    if let Err(Ended::Dismissed(code, reason)) = ended {
        page.frames.dismiss(code, reason);
    }
}

struct Page<'s> {
    hub: &'s Arc<Hub>,
    number: u64,
    frames: Frames<'s>,
    /// Numbers of the news that it was told.
    told: [u64; 2],
}

impl Page<'_> {
    fn run(&mut self) -> Result<(), Ended> {
        self.frames.text(self.hub.hello())?;
        let mut due = Instant::now();
        while !self.hub.quits() {
            let now = Instant::now();
            if now >= due {
                self.show()?;
                // A page that was slow gets the next frame at its time, not all that it missed.
                due = (due + FRAME_TIME).max(now);
            }
            let wait = due.saturating_duration_since(Instant::now());
            if let Some(message) = self.frames.read(wait.max(Duration::from_millis(1)))? {
                self.hear(&message)?;
            }
        }
        Err(Ended::Dismissed(CloseCode::Away, "the program ends"))
    }

    /// News, then a frame.
    fn show(&mut self) -> Result<(), Ended> {
        if self.hub.news_numbers() != self.told {
            let news = self.hub.news();
            for (told, news) in self.told.iter_mut().zip(news) {
                if *told != news.number {
                    *told = news.number;
                    self.frames.text(news.text)?;
                }
            }
        }
        match self.hub.frame(self.number) {
            Some(frame) => self.frames.binary(frame.bytes().to_vec()),
            None => Ok(()),
        }
    }

    fn hear(&self, message: &[u8]) -> Result<(), Ended> {
        let request = Request::read(message).ok_or(NOT_UNDERSTOOD)?;
        self.hub.ask(self.number, &request);
        Ok(())
    }
}
