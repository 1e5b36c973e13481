//! Energy tables for programs in C and C++: load, ask, query, close.
//!
//! The header is `include/pegfit.h`; `docs/c-api.md` has an example. Nothing here panics into the
//! caller: every function that can fail returns a [`PegfitStatus`], and the text of the calling
//! thread's last failure is at hand.
//!
//! A table is named by a number, not by a pointer. A number whose table was closed is never used
//! again, so a stale one is an error and not a crash. Every function may be called from any thread
//! at any time; a table that is closed while others query it goes away when the last of them is
//! done.

mod failure;
mod handles;
mod pose;
mod status;
mod table;

pub use pose::{PegfitPose, PegfitResponse};
pub use status::{PegfitStatus, pegfit_last_error, pegfit_status_message, pegfit_version};
pub use table::{
    PegfitTable, PegfitTableInfo, pegfit_table_close, pegfit_table_info, pegfit_table_load,
    pegfit_table_query, pegfit_table_query_many,
};
