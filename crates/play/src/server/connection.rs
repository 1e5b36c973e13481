//! One connection: a request and its reply, or a page that watches and perhaps holds the hand.

use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tungstenite::handshake::derive_accept_key;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use crate::server::http::{self, Reply};
use crate::server::hub::Hub;
use crate::server::route::{Route, route};
use crate::wire::request::Request;

/// Time between two frames.
const FRAME_TIME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// Longest wait for bytes of a request's head, and for a page to take what it is sent.
const PATIENCE: Duration = Duration::from_secs(2);

/// Messages a page may send in a second; it needs about a hundred.
const MOST_MESSAGES: u32 = 400;

/// Most bytes of a message, and of what is read ahead.
const MOST_BYTES: usize = 64;

/// A page that the system sends no more to is given up at so many bytes.
const MOST_WAITING: usize = 1 << 20;

/// Serves one connection until it ends.
pub(crate) fn serve(hub: &Arc<Hub>, mut stream: TcpStream) {
    // A reply that cannot be sent has nobody to read it.
    let _ = answer(hub, &mut stream);
}

fn answer(hub: &Arc<Hub>, stream: &mut TcpStream) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let Some(head) = http::read(stream) else {
        let bad = Reply::refused("400 Bad Request");
        return bad.write(&http::policy("localhost", false), stream);
    };
    match route(hub, &head) {
        Route::Reply(reply) => reply.write(&policy(hub, &head.host), stream),
        Route::Socket(key) => {
            let accept = derive_accept_key(key.as_bytes());
            write!(
                stream,
                "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\n\
                 Upgrade: websocket\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
            )?;
            watch(hub, stream);
            Ok(())
        }
    }
}

/// The policy names the host only if it is one of ours.
fn policy(hub: &Hub, host: &str) -> String {
    let host = match hub.access.is_own_host(host) {
        true => host,
        false => "localhost",
    };
    http::policy(host, hub.access.embed)
}

/// A page until it goes, or is shown the door.
fn watch(hub: &Arc<Hub>, stream: &mut TcpStream) {
    let config = WebSocketConfig::default()
        .read_buffer_size(4096)
        .max_message_size(Some(MOST_BYTES))
        .max_frame_size(Some(MOST_BYTES))
        .max_write_buffer_size(MOST_WAITING);
    let socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
    let mut page = Page {
        hub,
        number: hub.enter(),
        socket,
        told: [0; 2],
        heard: Budget::new(Instant::now()),
    };
    // Whatever ended it, nobody is there to be told.
    let _ = page.run();
    hub.leave(page.number);
}

/// Why a page's connection ends.
type Ended = tungstenite::Error;

struct Page<'s> {
    hub: &'s Arc<Hub>,
    number: u64,
    socket: WebSocket<&'s mut TcpStream>,
    /// Numbers of the news that it was told.
    told: [u64; 2],
    heard: Budget,
}

impl Page<'_> {
    fn run(&mut self) -> Result<(), Ended> {
        self.socket.send(Message::text(self.hub.hello()))?;
        let mut due = Instant::now();
        while !self.hub.quits() {
            let now = Instant::now();
            if now >= due {
                self.show()?;
                // A page that was slow gets the next frame at its time, not all that it missed.
                due = (due + FRAME_TIME).max(now);
            }
            let wait = due.saturating_duration_since(Instant::now());
            let wait = wait.max(Duration::from_millis(1));
            self.socket.get_ref().set_read_timeout(Some(wait))?;
            match self.socket.read() {
                Ok(message) => self.hear(&message)?,
                Err(Ended::Io(e)) if is_silence(&e) => {}
                Err(Ended::Capacity(e)) => {
                    self.dismiss(CloseCode::Size, "too long")?;
                    return Err(e.into());
                }
                Err(e) => return Err(e),
            }
        }
        self.dismiss(CloseCode::Away, "the program ends")
    }

    /// News, then a frame.
    fn show(&mut self) -> Result<(), Ended> {
        if self.hub.news_numbers() != self.told {
            let news = self.hub.news();
            for (told, news) in self.told.iter_mut().zip(news) {
                if *told != news.number {
                    *told = news.number;
                    self.socket.send(Message::text(news.text))?;
                }
            }
        }
        if let Some(frame) = self.hub.frame(self.number) {
            self.socket.send(Message::binary(frame.bytes().to_vec()))?;
        }
        Ok(())
    }

    fn hear(&mut self, message: &Message) -> Result<(), Ended> {
        if !self.heard.spend(Instant::now()) {
            return self.dismiss(CloseCode::Policy, "too many messages");
        }
        match message {
            Message::Binary(bytes) => match Request::read(bytes) {
                Some(request) => self.hub.ask(self.number, &request),
                None => return self.dismiss(CloseCode::Unsupported, "not understood"),
            },
            Message::Text(_) => return self.dismiss(CloseCode::Unsupported, "not understood"),
            // The library answers these itself.
            Message::Ping(_) | Message::Pong(_) | Message::Close(_) | Message::Frame(_) => {}
        }
        Ok(())
    }

    /// Closes with a reason; what the page still says is not waited for.
    fn dismiss(&mut self, code: CloseCode, reason: &'static str) -> Result<(), Ended> {
        let reason = reason.into();
        self.socket.close(Some(CloseFrame { code, reason }))?;
        self.socket.flush()?;
        Err(Ended::ConnectionClosed)
    }
}

/// Nothing came in time.
fn is_silence(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

/// Messages of the present second.
#[derive(Debug)]
struct Budget {
    began: Instant,
    count: u32,
}

impl Budget {
    fn new(now: Instant) -> Self {
        Self {
            began: now,
            count: 0,
        }
    }

    /// Counts a message; false if it is one too many.
    fn spend(&mut self, now: Instant) -> bool {
        if now.saturating_duration_since(self.began) >= Duration::from_secs(1) {
            *self = Self::new(now);
        }
        self.count += 1;
        self.count <= MOST_MESSAGES
    }
}
