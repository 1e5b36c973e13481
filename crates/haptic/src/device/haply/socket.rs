//! The service's WebSocket.

use std::io::ErrorKind;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, WebSocket, client};

use crate::device::contract::DeviceError;
use crate::device::haply::message::Message;
use crate::device::haply::options::VARIABLE;

/// The service, to a user.
pub(super) const NAME: &str = "Haply Inverse Service";

/// Longest wait for the connection, for its handshake and for the first message.
const GREETING: Duration = Duration::from_millis(500);

/// Longest wait for an answer before the caller does something about it.
const ANSWER: Duration = Duration::from_millis(5);

/// Longest message taken, bytes; those of a dozen devices have some twenty thousand.
const LONGEST: usize = 1 << 20;

/// Most pings and the like read at once.
const PINGS: u32 = 8;

/// What the system calls a message that has not come in time.
const LATE: [ErrorKind; 2] = [ErrorKind::WouldBlock, ErrorKind::TimedOut];

/// A connection.
pub(super) struct Socket(WebSocket<TcpStream>);

impl Socket {
    /// Connects, and reads the first message, which describes all devices.
    pub(super) fn connect(address: SocketAddr) -> Result<(Self, Message), DeviceError> {
        let stream = TcpStream::connect_timeout(&address, GREETING).map_err(|e| {
            DeviceError::NotInstalled {
                name: NAME.into(),
                reason: format!(
                    "nothing answers at {address} ({e}); install it and start it, on Linux by \
                     `systemctl start haply-inverse-service`, or set {VARIABLE} to its address"
                ),
            }
        })?;
        let io = |e: std::io::Error| gone(&e);
        stream.set_nodelay(true).map_err(io)?;
        stream.set_read_timeout(Some(GREETING)).map_err(io)?;
        stream.set_write_timeout(Some(GREETING)).map_err(io)?;
        let config = WebSocketConfig::default()
            .max_message_size(Some(LONGEST))
            .max_frame_size(Some(LONGEST));
        let request = format!("ws://{address}/");
        let connected = client::client_with_config(request, stream, Some(config));
        let (socket, _) = connected.map_err(|e| unsuitable(&e.to_string()))?;
        let mut socket = Self(socket);
        let Some(first) = socket.read()? else {
            return Err(unsuitable("nothing"));
        };
        let stream = socket.0.get_ref();
        stream.set_read_timeout(Some(ANSWER)).map_err(io)?;
        stream.set_write_timeout(Some(ANSWER)).map_err(io)?;
        Ok((socket, first))
    }

    /// Says something.
    pub(super) fn send(&mut self, text: String) -> Result<(), DeviceError> {
        self.0.send(text.into()).map_err(|e| gone(&e))
    }

    /// The next message; `None` if none has come in time.
    pub(super) fn read(&mut self) -> Result<Option<Message>, DeviceError> {
        // Pings, which the library answers, come between; nobody sends more of them than answers.
        for _ in 0..PINGS {
            return match self.0.read() {
                Ok(tungstenite::Message::Text(text)) => match serde_json::from_str(&text) {
                    Ok(message) => Ok(Some(message)),
                    Err(error) => Err(unsuitable(&error.to_string())),
                },
                Ok(tungstenite::Message::Binary(_)) => Err(unsuitable("a binary message")),
                Ok(tungstenite::Message::Close(_)) => Err(gone(&Error::ConnectionClosed)),
                Ok(_) => continue,
                Err(Error::Io(e)) if LATE.contains(&e.kind()) => Ok(None),
                Err(error) => Err(gone(&error)),
            };
        }
        Ok(None)
    }

    /// Says goodbye, if it is still heard.
    pub(super) fn close(&mut self) {
        // A service that is gone needs no goodbye.
        let _ = self.0.close(None);
        let _ = self.0.flush();
    }
}

fn gone(error: &dyn std::error::Error) -> DeviceError {
    DeviceError::System {
        name: NAME.into(),
        reason: format!("it has gone: {error}"),
    }
}

fn unsuitable(found: &str) -> DeviceError {
    DeviceError::Unsuitable {
        name: NAME.into(),
        expected: "the JSON of version 3.1 or later".into(),
        found: found.to_owned(),
    }
}
