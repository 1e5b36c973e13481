//! The haptic loop on a page: a browser's hand holds the moving part, and sees what the loop does.
//!
//! ```text
//! browser ──orders──> Steering ──> SteeredHand ──> the loop of `haptic`
//!    ^                                                 │
//!    └──frames, 60 a second── Viewer <── triple buffer ┘
//! ```
//!
//! [`Server`] listens on this machine and serves the page, which is part of the program; whoever
//! has the address with its token may watch, one at a time holds the hand. [`Server::perform`] runs
//! the loop on a [`Stage`]: the threads that serve never hold it up. What a page may ask besides
//! comes from the stage's [`Exhibits`]. Messages and their layouts are in `docs/play.md`.

mod error;
mod server;
mod stage;
mod wire;

pub use error::PlayError;
pub use server::access::token;
pub use server::serve::{Options, Server};
pub use stage::exhibits::{Exhibits, NoExhibits};
pub use stage::scenery::Stage;
pub use wire::frame::{FRAME_BYTES, Frame};
pub use wire::mesh::{MOST_TRIANGLES, MeshMessage};
pub use wire::request::Request;
