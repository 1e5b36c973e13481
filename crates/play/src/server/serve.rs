//! Listening, and running the loop on a session while pages watch.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use haptic::{Clock, LoopReport, OperatorConfig, RemoteCommand, RemoteDevice, Session};

use crate::error::PlayError;
use crate::server::access::{Access, token};
use crate::server::broadcaster::Broadcaster;
use crate::server::listen::listen;
use crate::session::content::PlaySession;
use crate::session::live_session::LiveSession;
use crate::session::rate_meter::RateMeter;
use crate::session::recorder::Recorder;

/// Pause between two readings for the end.
const POLL_PAUSE: Duration = Duration::from_millis(5);

/// Greatest force and torque of the page's hand as shares of the loop's limits: a hand that is
/// as strong as what the loop may show would go through every wall.
const STRENGTH: f64 = 0.6;

/// The page's hand weighs nothing but itself, kg, and is damped accordingly, N·s/m: it keeps up
/// with a mouse.
const LIGHT: (f64, f64) = (0.1, 8.0);

/// Where to listen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Address of this machine; 127.0.0.1 can only be reached from it.
    pub bind: IpAddr,
    /// Port; any that is free if 0.
    pub port: u16,
    /// Pages of this machine, a notebook's, may show the page in a frame.
    pub embed: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            bind: Ipv4Addr::LOCALHOST.into(),
            port: 0,
            embed: false,
        }
    }
}

/// A server that listens until it is dropped.
pub struct Server {
    broadcaster: Arc<Broadcaster>,
    listener: Option<JoinHandle<()>>,
}

impl Server {
    /// Listens, with a fresh token; pages may choose among `pairs` by their titles.
    ///
    /// # Errors
    /// If the address cannot be had, or the system gives no token or thread.
    pub fn start(options: &Options, pairs: Vec<String>) -> Result<Self, PlayError> {
        let address = SocketAddr::new(options.bind, options.port);
        let failed = |source| PlayError::Listen { address, source };
        let socket = TcpListener::bind(address).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        let access = Access {
            token: token()?,
            address: socket.local_addr().map_err(failed)?,
            embed: options.embed,
        };
        let broadcaster = Arc::new(Broadcaster::new(access, pairs));
        let shared = Arc::clone(&broadcaster);
        let thread = std::thread::Builder::new().name("play-listen".into());
        let listener = thread
            .spawn(move || listen(&shared, &socket))
            .map_err(PlayError::Thread)?;
        Ok(Self {
            broadcaster,
            listener: Some(listener),
        })
    }

    /// The address to open. It contains the token, which grants access.
    pub fn url(&self) -> String {
        let Access { token, address, .. } = &self.broadcaster.access;
        let host = match address.ip().is_unspecified() {
            true => SocketAddr::new(Ipv4Addr::LOCALHOST.into(), address.port()),
            false => *address,
        };
        format!("http://{host}/{token}/")
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.broadcaster.access.address
    }

    /// The pair that the controlling page wants; all pages learn that it is being loaded.
    pub fn wanted(&self) -> usize {
        let (pair, _) = self.broadcaster.take_wanted();
        self.broadcaster.announce_loading(pair);
        pair
    }

    /// Runs the loop on a session, in real time, until `cancel` is set or a page wants another
    /// pair.
    ///
    /// # Errors
    /// If the loop cannot run or its hand not be stopped.
    pub fn run_session(
        &self,
        session: &PlaySession<'_>,
        cancel: &AtomicBool,
    ) -> Result<LoopReport, PlayError> {
        let hand = OperatorConfig {
            mass: LIGHT.0,
            damping: LIGHT.1,
            strength: STRENGTH * session.config.limits.force,
            rotational_strength: STRENGTH * session.config.limits.torque,
            // The scripts go on until somebody does something else.
            duration: 1e6,
            ..OperatorConfig::default()
        };
        let (workspace, geometry) = (session.workspace, session.geometry);
        let (mut hand, mut remote) = RemoteDevice::new(
            hand,
            geometry,
            workspace,
            &session.start,
            session.config.times(),
        );
        // One command, so that the part is where it is shown from the first frame on.
        remote.command(RemoteCommand::LetGo);
        let recorder = Recorder::default();
        let mut haptic_session = Session::new(session.config.clone(), workspace);
        let viewer = haptic_session.viewer();
        let haptic_session = haptic_session.record_with(Box::new(recorder.clone()));
        let haptic_session = haptic_session.guided(session.joints.clone());
        self.broadcaster
            .begin_session(session.start, |number| LiveSession {
                number,
                content: Arc::clone(&session.content),
                recorder,
                remote,
                viewer,
                workspace,
                geometry,
                path: session.path.clone(),
                meter: RateMeter::default(),
                doing: 0,
            });
        let outcome = self.run_until(cancel, |stop| {
            haptic_session.run(&mut hand, session.source, Clock::Real, f64::INFINITY, stop)
        });
        self.broadcaster.end_session();
        Ok(outcome?.report)
    }

    /// Runs `work` with a flag that is set when it has to stop.
    fn run_until<T>(&self, cancel: &AtomicBool, work: impl FnOnce(&AtomicBool) -> T) -> T {
        let (stop, done) = (AtomicBool::new(false), AtomicBool::new(false));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    if cancel.load(Ordering::Relaxed) || self.broadcaster.is_other_wanted() {
                        stop.store(true, Ordering::Relaxed);
                    }
                    std::thread::sleep(POLL_PAUSE);
                }
            });
            let result = work(&stop);
            done.store(true, Ordering::Relaxed);
            result
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.broadcaster.quit.store(true, Ordering::Relaxed);
        if let Some(thread) = self.listener.take() {
            // It has nothing to fail at.
            let _ = thread.join();
        }
    }
}
