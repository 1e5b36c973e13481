//! A session with a wall, a server on it, and pages of tungstenite.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{Geometry, HapticConfig, LoopReport, TimedPath, Workspace};
use pegfit_play::{FRAME_BYTES, NoContent, Options, PlaySession, Request, Server};
use tungstenite::client::IntoClientRequest;
use tungstenite::protocol::frame::coding::CloseCode;
use tungstenite::{Message, WebSocket};

/// Longest that anything may take on a machine that does much else.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// A wall below z = 0 of 3000 N/m.
pub(crate) struct Wall;

impl EnergySource for Wall {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let deep = (-pose.translation.z).max(0.0);
        Response {
            energy: 1500.0 * deep * deep,
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: DVec3::Z * (3000.0 * deep),
            },
            coverage: 1.0,
        }
    }
}

/// A pose over the wall, `z` metres high.
pub(crate) fn over(z: f64) -> Pose {
    Pose::from_translation(DVec3::new(0.0, 0.0, z))
}

/// A server with the wall on its session, until it is ended or dropped.
pub(crate) struct Theatre {
    pub(crate) url: String,
    pub(crate) address: SocketAddr,
    pub(crate) token: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Vec<LoopReport>>>,
}

impl Theatre {
    pub(crate) fn open() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, receiver) = std::sync::mpsc::channel();
        let flag = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let titles = ["one", "two"].map(str::to_owned).to_vec();
            let server = Server::start(&Options::default(), titles).unwrap();
            sender.send((server.url(), server.address())).unwrap();
            let mut reports = Vec::new();
            while !flag.load(Ordering::Relaxed) {
                let pair = server.wanted();
                let session = session(0.03 + pair as f64 * 0.01);
                reports.push(server.run_session(&session, &flag).unwrap());
            }
            reports
        });
        let (url, address) = receiver.recv().unwrap();
        let token = url.split('/').nth(3).unwrap().to_owned();
        Self {
            url,
            address,
            token,
            stop,
            thread: Some(thread),
        }
    }

    /// Ends it; what the loops were like, a session after the other.
    pub(crate) fn end(mut self) -> Vec<LoopReport> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap()
    }

    /// A page of this server's own.
    pub(crate) fn page(&self) -> Page {
        let origin = format!("http://{}", self.address);
        Page::open(self, &self.token, Some(&origin)).unwrap()
    }

    /// A reply to a request as text, head and body.
    pub(crate) fn ask(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut reply = Vec::new();
        // A server that closes while bytes wait for it resets the connection.
        let _ = stream.read_to_end(&mut reply);
        String::from_utf8_lossy(&reply).into_owned()
    }

    /// A reply to a browser's request for a path behind the token.
    pub(crate) fn get(&self, name: &str) -> String {
        let (address, token) = (self.address, &self.token);
        self.ask(&format!(
            "GET /{token}/{name} HTTP/1.1\r\nHost: {address}\r\n\r\n"
        ))
    }
}

impl Drop for Theatre {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

pub(crate) fn session(start: f64) -> PlaySession<'static> {
    let config = HapticConfig {
        ramp_s: 0.1,
        ..HapticConfig::default()
    };
    let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
    PlaySession {
        source: &Wall,
        config,
        workspace,
        // Only the first pair has one: down, through the wall.
        joints: Vec::new(),
        path: (start < 0.035)
            .then(|| TimedPath::new(&[over(0.02), over(0.01), over(-0.02)], &workspace).unwrap()),
        geometry: Geometry {
            seated: Pose::IDENTITY,
            axis: DVec3::NEG_Z,
            depth: 0.03,
            radius: 0.01,
            tilt: 0.05,
        },
        start: over(start),
        content: Arc::new(NoContent),
    }
}

/// What a page sees, as far as these tests look.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub(crate) is_hand: bool,
    pub(crate) is_held: bool,
    pub(crate) pages: u8,
    pub(crate) session: u32,
    pub(crate) flags: u16,
    pub(crate) height: f64,
    pub(crate) force: f64,
    pub(crate) ticks: u32,
    pub(crate) recorded: f64,
    pub(crate) wall: f64,
}

impl Seen {
    pub(crate) fn read(bytes: &[u8]) -> Self {
        assert_eq!(bytes.len(), FRAME_BYTES);
        let four = |at: usize| -> [u8; 4] { bytes[at..at + 4].try_into().unwrap() };
        let float = |at| f64::from(f32::from_le_bytes(four(at)));
        Self {
            is_hand: bytes[1] == 1,
            flags: u16::from_le_bytes([bytes[2], bytes[3]]),
            session: u32::from_le_bytes(four(4)),
            wall: f64::from_le_bytes(bytes[16..24].try_into().unwrap()),
            height: float(60),
            force: DVec3::new(float(80), float(84), float(88)).length(),
            recorded: float(140),
            ticks: u32::from_le_bytes(four(144)),
            pages: bytes[153],
            is_held: bytes[154] == 1,
        }
    }
}

/// A page, as the browser's script would be.
pub(crate) struct Page {
    pub(crate) socket: WebSocket<TcpStream>,
    pub(crate) texts: Vec<String>,
}

impl Page {
    /// Opens a socket, or gives the status with which it is refused.
    pub(crate) fn open(theatre: &Theatre, token: &str, origin: Option<&str>) -> Result<Self, u16> {
        let stream = TcpStream::connect(theatre.address).unwrap();
        stream.set_nodelay(true).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let url = format!("ws://{}/{token}/ws", theatre.address);
        let mut request = url.into_client_request().unwrap();
        if let Some(origin) = origin {
            request
                .headers_mut()
                .insert("Origin", origin.parse().unwrap());
        }
        match tungstenite::client(request, stream) {
            Ok((socket, _)) => Ok(Self {
                socket,
                texts: Vec::new(),
            }),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(reply))) => {
                Err(reply.status().as_u16())
            }
            Err(other) => panic!("{other}"),
        }
    }

    pub(crate) fn say(&mut self, request: Request) {
        let bytes = Message::binary(request.bytes());
        // A page that was shown the door has nobody to talk to.
        let _ = self.socket.send(bytes);
    }

    /// The next frame; texts on the way are kept.
    pub(crate) fn frame(&mut self) -> Seen {
        loop {
            match self.socket.read().unwrap() {
                Message::Binary(bytes) => return Seen::read(&bytes),
                Message::Text(text) => self.texts.push(text.to_string()),
                _ => {}
            }
        }
    }

    /// Frames until one is as wanted, a request after each.
    pub(crate) fn until(
        &mut self,
        request: Option<Request>,
        wanted: impl Fn(&Seen) -> bool,
    ) -> Seen {
        let began = Instant::now();
        loop {
            let seen = self.frame();
            if wanted(&seen) {
                return seen;
            }
            assert!(began.elapsed() < PATIENCE, "{seen:?}");
            if let Some(request) = request {
                self.say(request);
            }
        }
    }

    /// Presses on the wall until it is felt.
    pub(crate) fn press(&mut self) -> Seen {
        self.say(Request::Take);
        let push = Request::Hold(over(-0.02));
        self.until(Some(push), |seen| seen.force > 1.0)
    }

    /// The code with which the server closes.
    pub(crate) fn dismissed(&mut self) -> Option<CloseCode> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            match self.socket.read() {
                Ok(Message::Close(frame)) => return frame.map(|f| f.code),
                Ok(_) => {}
                Err(_) => return None,
            }
        }
        panic!("still there");
    }
}
