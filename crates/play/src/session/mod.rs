//! A session on a page: a source of energy, what a page is shown of it, and the loop's recorder.

pub(crate) mod content;
pub(crate) mod live_session;
pub(crate) mod local_session;
pub(crate) mod rate_meter;
pub(crate) mod recorder;
pub(crate) mod scene_content;
