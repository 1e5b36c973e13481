//! The server: who may come in, what they are given, and the page that holds the hand.

pub(crate) mod access;
mod broadcaster;
mod connection;
mod http;
mod listen;
mod route;
pub(crate) mod serve;
mod websocket;
