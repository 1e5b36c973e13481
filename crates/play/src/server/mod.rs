//! The server: who may come in, what they are given, and the page that holds the hand.

pub(crate) mod access;
mod assets;
mod connection;
mod door;
mod frames;
mod http;
mod hub;
mod listen;
mod route;
pub(crate) mod serve;
