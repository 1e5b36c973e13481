//! Long work beside Python: threads, progress, Ctrl-C.

mod monitor;
mod pools;
pub(crate) mod run;
