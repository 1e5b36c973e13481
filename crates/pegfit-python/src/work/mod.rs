//! Long work beside Python: threads, progress, Ctrl-C.

mod monitor;
pub(crate) mod pools;
pub(crate) mod run;
