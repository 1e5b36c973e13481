//! The service's WebSocket.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, WebSocket, client};

use crate::device::contract::DeviceError;
use crate::device::haply::message::Message;
use crate::device::text::printable;

/// The service, to a user.
pub(super) const NAME: &str = "Haply Inverse Service";

/// Environment variable that names another address.
pub(super) const VARIABLE: &str = "PEGFIT_HAPLY";

/// Longest time for the connection, its handshake and the first message, all together: whatever
/// listens there, nobody waits longer.
const GREETING: Duration = Duration::from_secs(2);

/// Longest wait for an answer before the caller does something about it, and for what is sent.
const ANSWER: Duration = Duration::from_millis(5);

/// Longest message taken, bytes; those of a dozen devices have some twenty thousand.
const LONGEST: usize = 1 << 20;

/// Bytes read ahead at once.
const READ_AHEAD: usize = 1 << 15;

/// A connection.
pub(super) struct Socket(WebSocket<TimedStream>);

impl Socket {
    /// Connects, and reads the first message, which describes all devices.
    pub(super) fn connect(address: SocketAddr) -> Result<(Self, Message), DeviceError> {
        let deadline = Instant::now() + GREETING;
        let stream = TcpStream::connect_timeout(&address, GREETING).map_err(|e| {
            DeviceError::NotInstalled {
                name: NAME.into(),
                reason: format!(
                    "nothing answers at {address} ({e}); install it and start it, on Linux by \
                     `systemctl start haply-inverse-service`, or set {VARIABLE} to its address"
                ),
            }
        })?;
        stream.set_nodelay(true).map_err(|e| gone(&e))?;
        let config = WebSocketConfig::default()
            .read_buffer_size(READ_AHEAD)
            .max_message_size(Some(LONGEST))
            .max_frame_size(Some(LONGEST));
        let request = format!("ws://{address}/");
        let stream = TimedStream::new(stream, deadline);
        let connected = client::client_with_config(request, stream, Some(config));
        let (socket, _) = connected.map_err(|e| match e {
            HandshakeError::Failure(Error::Io(e)) if is_timeout(&e) => no_greeting(address),
            other => unsuitable(&other.to_string()),
        })?;
        let mut socket = Self(socket);
        match socket.next()? {
            Some(first) => Ok((socket, first)),
            None => Err(no_greeting(address)),
        }
    }

    /// Sends a message.
    pub(super) fn send(&mut self, text: String) -> Result<(), DeviceError> {
        self.0.get_mut().set_timeout(ANSWER);
        self.0.send(text.into()).map_err(|e| gone(&e))
    }

    /// The next message; `None` if none has come in time.
    pub(super) fn read(&mut self) -> Result<Option<Message>, DeviceError> {
        self.0.get_mut().set_timeout(ANSWER);
        self.next()
    }

    fn next(&mut self) -> Result<Option<Message>, DeviceError> {
        loop {
            return match self.0.read() {
                Ok(tungstenite::Message::Text(text)) => match Message::read(&text) {
                    Ok(message) => Ok(Some(message)),
                    Err(why) => Err(unsuitable(&why)),
                },
                Ok(tungstenite::Message::Binary(_)) => Err(unsuitable("a binary message")),
                Ok(tungstenite::Message::Close(_)) => Err(gone(&Error::ConnectionClosed)),
                // Pings, which the library answers; however many there are, their time ends.
                Ok(_) => continue,
                Err(Error::Io(e)) if is_timeout(&e) => Ok(None),
                Err(error) => Err(gone(&error)),
            };
        }
    }

    /// Says goodbye, if it is still heard.
    pub(super) fn close(&mut self) {
        self.0.get_mut().set_timeout(ANSWER);
        // A service that is gone needs no goodbye.
        let _ = self.0.close(None);
        let _ = self.0.flush();
    }
}

/// What the system calls a message that has not come in time.
fn is_timeout(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

/// Something listens there, but does not talk as the service does.
fn no_greeting(address: SocketAddr) -> DeviceError {
    DeviceError::System {
        name: NAME.into(),
        reason: format!(
            "what listens at {address} has not said within {GREETING:?} which devices there are; \
             is it the service, or does another program have its port?"
        ),
    }
}

fn gone(error: &dyn std::error::Error) -> DeviceError {
    DeviceError::System {
        name: NAME.into(),
        reason: format!("it has gone: {}", printable(&error.to_string())),
    }
}

fn unsuitable(found: &str) -> DeviceError {
    DeviceError::Unsuitable {
        name: NAME.into(),
        expected: "the JSON of version 3.1 or later".into(),
        found: printable(found),
    }
}

/// A stream with a time at which every call ends.
struct TimedStream {
    stream: TcpStream,
    deadline: Instant,
}

impl TimedStream {
    /// Calls end at `deadline`.
    fn new(stream: TcpStream, deadline: Instant) -> Self {
        Self { stream, deadline }
    }

    /// From now on calls end after `time`, all of them together.
    fn set_timeout(&mut self, time: Duration) {
        self.deadline = Instant::now() + time;
    }

    fn remaining(&self) -> io::Result<Duration> {
        match self.deadline.saturating_duration_since(Instant::now()) {
            Duration::ZERO => Err(ErrorKind::TimedOut.into()),
            left => Ok(left),
        }
    }
}

/// Systems call it one thing or another.
fn unify_timeout(error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::WouldBlock => ErrorKind::TimedOut.into(),
        _ => error,
    }
}

impl Read for TimedStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(Some(self.remaining()?))?;
        self.stream.read(buffer).map_err(unify_timeout)
    }
}

impl Write for TimedStream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(Some(self.remaining()?))?;
        self.stream.write(bytes).map_err(unify_timeout)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}
