//! Scenes: many fixed parts, of which those near the moving part are loaded, by a thread of its
//! own, within a memory budget, and loaded again when their files change.

mod box_tree;
pub(crate) mod error;
pub(crate) mod event;
mod keeper;
pub(crate) mod live_scene;
pub(crate) mod live_source;
pub(crate) mod options;
pub(crate) mod pair;
pub(crate) mod pair_loading;
mod rotations;
pub(crate) mod shared;
mod slot;
mod snapshot;
pub(crate) mod sum;
mod tables;

pub use error::LiveSceneError;
pub use event::{PairState, SceneChange, SceneEvent};
pub use pair::{Content, LoadFailure, Loaded, Loader};
pub use pair_loading::{beside_the_loop, direct_reach, table_reach};
