//! The server without a browser: who comes in, who holds the hand, and what the loop makes of it.

mod common;
mod entry;
mod hand;
mod load;
mod local;
