//! The haptic loop on a page: a browser's hand holds the moving part, and sees what the loop does.
//!
//! ```text
//! browser ──commands──> RemoteControl ──> RemoteDevice ──> the loop of `haptic`
//!    ^                                                 │
//!    └──frames, 60 a second── Viewer <── triple buffer ┘
//! ```
//!
//! [`Server`] listens on this machine and serves the page, which is part of the program; whoever
//! has the address with its token may watch, one at a time holds the hand. [`Server::run_session`]
//! runs the loop on a [`PlaySession`]: the threads that serve never hold it up. What a page may ask
//! besides comes from the session's [`Content`], of a scene [`SceneContent`]. Messages and their
//! layouts are in `docs/play.md`.
//!
//! In a browser there are neither threads nor a server: there a page's worker steps a
//! [`LocalSession`] and hands the same messages on.

mod error;
mod protocol;
#[cfg(not(target_family = "wasm"))]
mod server;
mod session;

pub use error::PlayError;
pub use protocol::frame::{FRAME_BYTES, Frame};
pub use protocol::mesh::{MOST_TRIANGLES, MeshMessage};
pub use protocol::request::Request;
#[cfg(not(target_family = "wasm"))]
pub use server::access::token;
#[cfg(not(target_family = "wasm"))]
pub use server::serve::{Options, Server};
pub use session::content::{Content, NoContent, PlaySession};
pub use session::local_session::LocalSession;
pub use session::scene_content::{PlayedScene, SceneContent, start_pose};
