//! The messages between server and page; `docs/play.md` lists their layouts.

pub(crate) mod frame;
pub(crate) mod mesh;
pub(crate) mod request;
