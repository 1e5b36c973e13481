//! Scenes: many fixed parts. A thread of its own loads those near the moving part, within a memory
//! budget, and loads them again when their files change.

pub(crate) mod event;
pub(crate) mod live_scene;
pub(crate) mod live_source;
pub(crate) mod pair;
pub(crate) mod residency;
mod rotations;
pub(crate) mod sum;

pub use event::{PairState, SceneChange, SceneEvent};
pub use pair::{
    Content, LoadFailure, LoadedPair, Loader, direct_reach, table_reach, with_spare_core,
};
pub use residency::LiveSceneError;
