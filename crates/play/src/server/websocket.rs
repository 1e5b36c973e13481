//! The server's end of a page's WebSocket. Every frame counts against the limit, empty ones and
//! parts of messages too, so that no page keeps the server reading for nothing.

use std::io::Read as _;
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use tungstenite::Error;
use tungstenite::protocol::frame::coding::{CloseCode, Control, Data, OpCode};
use tungstenite::protocol::frame::{CloseFrame, Frame, FrameSocket};

/// Frames that a page may send in a second; it needs about a hundred.
const MOST_FRAMES: u32 = 400;

/// How long a page that is dismissed may take to close its end.
const LINGERS: Duration = Duration::from_millis(200);

/// Most bytes of a message, and of a frame.
const MOST_BYTES: usize = 64;

/// Most frames of one message. A browser sends one; a proxy between may cut it.
const MOST_PIECES: u32 = 4;

/// Why a page's connection ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum CloseReason {
    /// It is gone, or takes nothing more.
    Gone,
    /// The server closes it, with a code and a reason.
    Dismissed(CloseCode, &'static str),
}

/// The page sent something that no page sends.
pub(crate) const NOT_UNDERSTOOD: CloseReason =
    CloseReason::Dismissed(CloseCode::Unsupported, "not understood");
const TOO_LONG: CloseReason = CloseReason::Dismissed(CloseCode::Size, "too long");
const TOO_MANY: CloseReason = CloseReason::Dismissed(CloseCode::Policy, "too many messages");
const NO_FRAME: CloseReason = CloseReason::Dismissed(CloseCode::Protocol, "against the protocol");

/// The server's end of a WebSocket.
pub(crate) struct PageSocket<'s> {
    socket: FrameSocket<&'s mut TcpStream>,
    assembler: MessageAssembler,
}

impl<'s> PageSocket<'s> {
    /// After the handshake.
    pub(crate) fn new(stream: &'s mut TcpStream) -> Self {
        Self {
            socket: FrameSocket::new(stream),
            assembler: MessageAssembler::new(Instant::now()),
        }
    }

    /// Reads one frame, waiting for `wait` at most; the message that ends with it, if one does.
    pub(crate) fn read(&mut self, wait: Duration) -> Result<Option<Vec<u8>>, CloseReason> {
        let timeout = self.socket.get_ref().set_read_timeout(Some(wait));
        timeout.map_err(|_| CloseReason::Gone)?;
        let frame = match self.socket.read(Some(MOST_BYTES)) {
            Ok(Some(frame)) => frame,
            Err(Error::Io(e)) if is_timeout(&e) => return Ok(None),
            Err(Error::Capacity(_)) => return Err(TOO_LONG),
            Err(Error::Protocol(_)) => return Err(NO_FRAME),
            Ok(None) | Err(_) => return Err(CloseReason::Gone),
        };
        match self.assembler.push(&frame, Instant::now())? {
            Incoming::Partial => Ok(None),
            Incoming::Message(bytes) => Ok(Some(bytes)),
            Incoming::Ping(bytes) => self.send(Frame::pong(bytes)).map(|()| None),
            Incoming::Close => {
                // A page that closes need not hear the answer.
                let _ = self.send(Frame::close(None));
                Err(CloseReason::Gone)
            }
        }
    }

    pub(crate) fn text(&mut self, text: String) -> Result<(), CloseReason> {
        self.send(Frame::message(text, OpCode::Data(Data::Text), true))
    }

    pub(crate) fn binary(&mut self, bytes: Vec<u8>) -> Result<(), CloseReason> {
        self.send(Frame::message(bytes, OpCode::Data(Data::Binary), true))
    }

    /// Closes with a reason. What the page still says is read and dropped for a moment: a connection
    /// that is closed over unread bytes is reset, and then the page may never read the reason.
    pub(crate) fn dismiss(&mut self, code: CloseCode, reason: &'static str) {
        let reason = reason.into();
        // A page that does not read gets no reason.
        if (self.send(Frame::close(Some(CloseFrame { code, reason })))).is_err() {
            return;
        }
        let stream = self.socket.get_mut();
        let began = Instant::now();
        let quiet = stream.shutdown(Shutdown::Write).is_err()
            || stream.set_read_timeout(Some(LINGERS)).is_err();
        let mut dropped = [0; 1024];
        while !quiet && began.elapsed() < LINGERS {
            match stream.read(&mut dropped) {
                Ok(0) | Err(_) => return,
                Ok(_) => {}
            }
        }
    }

    fn send(&mut self, frame: Frame) -> Result<(), CloseReason> {
        self.socket.send(frame).map_err(|_| CloseReason::Gone)
    }
}

/// Nothing came in time.
fn is_timeout(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

/// What a frame is.
#[derive(Debug, PartialEq, Eq)]
enum Incoming {
    /// Part of a message that goes on, or nothing that matters.
    Partial,
    Message(Vec<u8>),
    Ping(Vec<u8>),
    Close,
}

/// Assembles messages from frames, and counts the frames of each second.
#[derive(Debug)]
struct MessageAssembler {
    /// When the present second began, and frames in it.
    second: Instant,
    count: u32,
    /// A message that goes on, and its frames so far.
    message: Option<(Vec<u8>, u32)>,
}

impl MessageAssembler {
    fn new(now: Instant) -> Self {
        Self {
            second: now,
            count: 0,
            message: None,
        }
    }

    fn push(&mut self, frame: &Frame, now: Instant) -> Result<Incoming, CloseReason> {
        if !self.count_frame(now) {
            return Err(TOO_MANY);
        }
        let header = frame.header();
        // Whoever asks for a page is masked, and no extension was agreed on.
        let mask = header.mask.ok_or(NO_FRAME)?;
        if header.rsv1 || header.rsv2 || header.rsv3 {
            return Err(NO_FRAME);
        }
        let mask = mask.iter().cycle();
        let bytes: Vec<u8> = frame
            .payload()
            .iter()
            .zip(mask)
            .map(|(b, m)| b ^ m)
            .collect();
        match header.opcode {
            OpCode::Control(_) if !header.is_final => Err(NO_FRAME),
            OpCode::Control(Control::Ping) => Ok(Incoming::Ping(bytes)),
            OpCode::Control(Control::Close) => Ok(Incoming::Close),
            OpCode::Control(Control::Pong) => Ok(Incoming::Partial),
            OpCode::Data(Data::Text) => Err(NOT_UNDERSTOOD),
            OpCode::Data(Data::Binary) if self.message.is_none() => {
                self.append((Vec::new(), 0), &bytes, header.is_final)
            }
            OpCode::Data(Data::Continue) => {
                let before = self.message.take().ok_or(NO_FRAME)?;
                self.append(before, &bytes, header.is_final)
            }
            OpCode::Data(_) | OpCode::Control(_) => Err(NO_FRAME),
        }
    }

    /// Goes on with a message.
    fn append(
        &mut self,
        (mut message, pieces): (Vec<u8>, u32),
        bytes: &[u8],
        is_final: bool,
    ) -> Result<Incoming, CloseReason> {
        message.extend_from_slice(bytes);
        if message.len() > MOST_BYTES {
            return Err(TOO_LONG);
        }
        if is_final {
            return Ok(Incoming::Message(message));
        }
        if pieces + 1 == MOST_PIECES {
            return Err(TOO_MANY);
        }
        self.message = Some((message, pieces + 1));
        Ok(Incoming::Partial)
    }

    /// Counts a frame; false if it is one too many.
    fn count_frame(&mut self, now: Instant) -> bool {
        if now.saturating_duration_since(self.second) >= Duration::from_secs(1) {
            (self.second, self.count) = (now, 0);
        }
        self.count += 1;
        self.count <= MOST_FRAMES
    }
}

#[cfg(test)]
mod tests {
    use tungstenite::protocol::frame::FrameHeader;

    use super::*;

    const BINARY: OpCode = OpCode::Data(Data::Binary);
    const MORE: OpCode = OpCode::Data(Data::Continue);
    const PING: OpCode = OpCode::Control(Control::Ping);

    /// A frame as it comes, masked.
    fn frame(opcode: OpCode, is_final: bool, bytes: &[u8]) -> Frame {
        let header = FrameHeader {
            is_final,
            opcode,
            mask: Some([1, 2, 3, 4]),
            ..FrameHeader::default()
        };
        let mask = [1, 2, 3, 4].into_iter().cycle();
        let masked: Vec<u8> = bytes.iter().zip(mask).map(|(b, m)| b ^ m).collect();
        Frame::from_payload(header, masked.into())
    }

    /// What the last of these frames is.
    fn assemble(frames: &[Frame]) -> Result<Incoming, CloseReason> {
        let now = Instant::now();
        let mut assembler = MessageAssembler::new(now);
        let mut last = Ok(Incoming::Partial);
        for frame in frames {
            last = assembler.push(frame, now);
        }
        last
    }

    #[test]
    fn a_message_is_one_frame_or_a_few() {
        let whole = assemble(&[frame(BINARY, true, &[1, 2, 3, 4, 5])]);
        assert_eq!(whole, Ok(Incoming::Message(vec![1, 2, 3, 4, 5])));
        // A ping may come between.
        let cut = assemble(&[
            frame(BINARY, false, &[1, 2]),
            frame(PING, true, &[9]),
            frame(MORE, false, &[]),
            frame(MORE, true, &[3]),
        ]);
        assert_eq!(cut, Ok(Incoming::Message(vec![1, 2, 3])));
        assert_eq!(
            assemble(&[frame(PING, true, &[7])]),
            Ok(Incoming::Ping(vec![7]))
        );
    }

    #[test]
    fn pieces_count_however_little_is_in_them() {
        let begin = frame(BINARY, false, &[]);
        let empty = vec![frame(MORE, false, &[]); MOST_PIECES as usize - 1];
        assert_eq!(
            assemble(&[vec![begin.clone()], empty].concat()),
            Err(TOO_MANY)
        );
        let long = [
            frame(BINARY, false, &[0; MOST_BYTES]),
            frame(MORE, true, &[0]),
        ];
        assert_eq!(assemble(&long), Err(TOO_LONG));
        let pings = vec![frame(PING, true, &[]); MOST_FRAMES as usize + 1];
        assert_eq!(assemble(&pings), Err(TOO_MANY));
    }

    #[test]
    fn a_second_later_there_is_room_again() {
        let now = Instant::now();
        let mut assembler = MessageAssembler::new(now);
        assert!(
            (0..MOST_FRAMES).all(|_| assembler.count_frame(now)) && !assembler.count_frame(now)
        );
        assert!(assembler.count_frame(now + Duration::from_secs(1)));
    }

    #[test]
    fn what_is_against_the_protocol_is_refused() {
        let plain = Frame::message(vec![0], BINARY, true);
        let mut reserved = frame(BINARY, true, &[0]);
        reserved.header_mut().rsv2 = true;
        for bad in [
            vec![plain],
            vec![reserved],
            vec![frame(MORE, true, &[0])],
            vec![frame(BINARY, false, &[0]), frame(BINARY, true, &[0])],
            vec![frame(PING, false, &[])],
        ] {
            assert_eq!(assemble(&bad), Err(NO_FRAME), "{bad:?}");
        }
        let text = frame(OpCode::Data(Data::Text), false, b"{");
        assert_eq!(assemble(&[text]), Err(NOT_UNDERSTOOD));
    }
}
