//! From a request's head to what it gets.

use crate::server::assets::asset;
use crate::server::http::{Head, Reply};
use crate::server::hub::Hub;

/// What a request gets.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Route {
    /// A reply, and goodbye.
    Reply(Reply),
    /// A WebSocket with this key.
    Socket(String),
}

/// What this head gets.
pub(crate) fn route(hub: &Hub, head: &Head) -> Route {
    match admit(hub, head) {
        Ok(name) => match (&head.socket_key, name) {
            (Some(key), "ws") => Route::Socket(key.clone()),
            _ => Route::Reply(reply(hub, name)),
        },
        Err(status) => Route::Reply(Reply::refused(status)),
    }
}

/// What is asked for, after the token; else why it is refused.
fn admit<'h>(hub: &Hub, head: &'h Head) -> Result<&'h str, &'static str> {
    let access = &hub.access;
    if !access.is_own_host(&head.host) {
        return Err("421 Misdirected Request");
    }
    let name = access.after_token(&head.path).ok_or("404 Not Found")?;
    if head.method != "GET" {
        return Err("405 Method Not Allowed");
    }
    let own = |origin: &str| access.is_own_origin(origin, &head.host);
    match (&head.origin, &head.socket_key) {
        // A browser always says where a socket comes from.
        (None, None) => Ok(name),
        (Some(origin), _) if own(origin) => Ok(name),
        _ => Err("403 Forbidden"),
    }
}

fn reply(hub: &Hub, name: &str) -> Reply {
    if let Some(found) = asset(name) {
        return found;
    }
    let found = match name {
        "log.csv" => hub
            .log()
            .map(|csv| Reply::ok("text/csv; charset=utf-8", csv)),
        name => (hub.exhibits())
            .and_then(|exhibits| exhibits.bytes(name))
            .map(|bytes| Reply::ok("application/octet-stream", bytes)),
    };
    found.unwrap_or_else(|| Reply::refused("404 Not Found"))
}
