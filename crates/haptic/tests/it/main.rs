//! The haptic loop from outside: feel, safety, sessions, exchanged sources, and how it ends.

#[path = "../common/mod.rs"]
mod common;
mod exchange;
mod feel;
#[cfg(unix)]
mod logs;
#[cfg(unix)]
mod makers;
mod outside;
mod passivity;
mod recordings;
mod safety;
mod session;
#[cfg(unix)]
mod stopping;
