//! The C interface as C sees it: header, example, misuse, threads.

mod example;
mod header;
mod misuse;
mod placed;
mod table;
mod threads;
