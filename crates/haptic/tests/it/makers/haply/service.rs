//! A stand-in for Haply's service, which answers as its maker documents it.

use std::io::Write;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket, accept};

/// How it behaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Manner {
    Answers,
    /// Listens, obeys, and says nothing.
    Silent,
    Garbage,
    Binary,
    /// Begins an answer and goes on for ever with pieces of nothing.
    EmptyPieces,
    /// Lists no arm any more.
    LosesDevice,
    /// Ends every connection; its devices go idle.
    Gone,
}

pub(super) struct State {
    pub(super) manner: Manner,
    pub(super) since_3_5: bool,
    pub(super) at: DVec3,
    pub(super) speed: DVec3,
    pub(super) grip: Option<DQuat>,
    pub(super) buttons: [bool; 3],
    pub(super) calibrated: bool,
    pub(super) powered: bool,
    pub(super) in_use: bool,
    pub(super) basis: &'static str,
    /// What the motors do, N.
    pub(super) force: DVec3,
    ends: bool,
}

/// The service; it ends when dropped.
pub(super) struct Service {
    state: Arc<Mutex<State>>,
    address: SocketAddr,
    thread: Option<JoinHandle<()>>,
}

impl Service {
    pub(super) fn start() -> Self {
        let state = Arc::new(Mutex::new(State {
            manner: Manner::Answers,
            since_3_5: true,
            at: DVec3::new(0.0, -0.15, 0.15),
            speed: DVec3::ZERO,
            grip: Some(DQuat::IDENTITY),
            buttons: [false; 3],
            calibrated: true,
            powered: true,
            in_use: false,
            basis: "XYZ",
            force: DVec3::ZERO,
            ends: false,
        }));
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        listener.set_nonblocking(true).unwrap();
        let shared = Arc::clone(&state);
        let thread = Some(std::thread::spawn(move || listen(&listener, &shared)));
        Self {
            state,
            address,
            thread,
        }
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    pub(super) fn with<T>(&self, look: impl FnOnce(&mut State) -> T) -> T {
        look(&mut self.state.lock().unwrap())
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.with(|s| s.ends = true);
        self.thread.take().unwrap().join().unwrap();
    }
}

fn listen(listener: &TcpListener, state: &Mutex<State>) {
    while !state.lock().unwrap().ends {
        match listener.accept() {
            Ok((stream, _)) => {
                // A client that leaves in the middle of its handshake is none.
                let _ = serve(stream, state);
                // A session that ends leaves its devices idle.
                state.lock().unwrap().force = DVec3::ZERO;
            }
            Err(_) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

/// One client at a time is all that a test has.
fn serve(stream: TcpStream, state: &Mutex<State>) -> Option<()> {
    stream.set_nonblocking(false).ok()?;
    stream.set_nodelay(true).ok()?;
    let mut socket = accept(stream).ok()?;
    socket
        .get_ref()
        .set_read_timeout(Some(Duration::from_millis(2)))
        .ok()?;
    answer(&mut socket, state, true)?;
    loop {
        if matches!(state.lock().unwrap().manner, Manner::Gone) || state.lock().unwrap().ends {
            return None;
        }
        match socket.read() {
            Ok(Message::Text(text)) => {
                obey(
                    &serde_json::from_str(&text).unwrap(),
                    &mut state.lock().unwrap(),
                );
                answer(&mut socket, state, false)?;
            }
            Ok(Message::Close(_)) => return None,
            Ok(_) => {}
            Err(tungstenite::Error::Io(_)) => {} // nothing yet
            Err(_) => return None,
        }
    }
}

/// Takes the force under the key of this version only.
fn obey(message: &Value, state: &mut State) {
    let key = if state.since_3_5 { "vector" } else { "values" };
    let order = &message["inverse3"][0];
    assert_eq!(order["device_id"], "049D");
    let force = &order["commands"]["set_cursor_force"][key];
    let number = |axis: &str| force[axis].as_f64().expect("a number under the right key");
    state.force = DVec3::new(number("x"), number("y"), number("z"));
}

fn answer(socket: &mut WebSocket<TcpStream>, state: &Mutex<State>, first: bool) -> Option<()> {
    let message = {
        let state = state.lock().unwrap();
        match state.manner {
            Manner::Gone => return None,
            Manner::Silent => return Some(()),
            Manner::EmptyPieces => {
                let stream = socket.get_mut();
                drop(state);
                stream.write_all(&[0x01, 0]).ok()?;
                // Until the client has enough of it.
                loop {
                    stream.write_all(&[0x00, 0]).ok()?;
                }
            }
            Manner::Garbage => Message::text("{\"inverse3\": [nonsense"),
            Manner::Binary => Message::binary(vec![1, 2, 3]),
            Manner::Answers | Manner::LosesDevice => Message::text(told(&state, first).to_string()),
        }
    };
    socket.send(message).ok()
}

fn told(state: &State, first: bool) -> Value {
    let vector = |v: DVec3| json!({ "x": v.x, "y": v.y, "z": v.z });
    let mut arm = json!({
        "device_id": "049D",
        "state": {
            "cursor_position": vector(state.at),
            "cursor_velocity": vector(state.speed),
            "control_mode": "idle",
        },
        "status": {
            "calibrated": state.calibrated,
            "in_use": state.in_use,
            "power_supply": state.powered,
            "ready": true,
            "started": true,
        },
    });
    if first {
        arm["config"] = json!({ "type": "inverse3", "basis": { "permutation": state.basis } });
    }
    let [a, b, c] = state.buttons;
    let grips: Vec<Value> = state
        .grip
        .iter()
        .map(|q| {
            json!({
                "device_id": "VG01",
                "state": {
                    "orientation": { "w": q.w, "x": q.x, "y": q.y, "z": q.z },
                    "buttons": { "a": a, "b": b, "c": c },
                    "battery_level": 0.8,
                },
            })
        })
        .collect();
    let arms = match state.manner {
        Manner::LosesDevice => json!([]),
        _ => json!([arm]),
    };
    let mut message = json!({ "inverse3": arms, "wireless_verse_grip": grips, "verse_grip": [] });
    if state.since_3_5 {
        message["session_id"] = json!(7);
    }
    message
}
