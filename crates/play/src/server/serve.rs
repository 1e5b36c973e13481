//! Listening, and running the loop on a session while pages watch.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use haptic::{Clock, LoopReport, Session};

use crate::error::PlayError;
use crate::server::access::{Access, token};
use crate::server::broadcaster::Broadcaster;
use crate::server::listen::listen;
use crate::session::content::PlaySession;
use crate::session::live_session::LiveSession;
use crate::session::recorder::Recorder;

/// Pause between two readings for the end.
const POLL_PAUSE: Duration = Duration::from_millis(5);

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
        let (mut hand, remote) = session.hand();
        let recorder = Recorder::default();
        let mut haptic_session = Session::new(session.config.clone(), session.workspace);
        let viewer = haptic_session.viewer();
        let haptic_session = haptic_session.record_with(Box::new(recorder.clone()));
        let haptic_session = haptic_session.guided(session.joints.clone());
        self.broadcaster.begin_session(session.start, |number| {
            LiveSession::new(session, number, recorder, remote, viewer)
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
