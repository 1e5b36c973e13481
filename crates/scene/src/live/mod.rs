//! A scene with several fixed parts, of which those near the moving part are kept in memory.

pub(crate) mod live_pairs;
mod pair_files;
