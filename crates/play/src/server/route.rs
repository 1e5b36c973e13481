//! From a request's head to what it gets.

use crate::server::assets::asset;
use crate::server::http::{Head, Reply};
use crate::server::hub::Hub;

/// A request that showed the key.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Guest {
    /// What the browser calls this server.
    pub(crate) host: String,
    /// What is asked for, after the key.
    pub(crate) name: String,
    /// The key of a WebSocket, if one is asked for.
    pub(crate) socket_key: Option<String>,
}

/// Lets a request in, else says why it is refused.
pub(crate) fn admit(hub: &Hub, head: Head) -> Result<Guest, &'static str> {
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
        (None, None) => {}
        (Some(origin), _) if own(origin) => {}
        _ => return Err("403 Forbidden"),
    }
    Ok(Guest {
        name: name.to_owned(),
        socket_key: head.socket_key.filter(|_| name == "ws"),
        host: head.host,
    })
}

/// The file or message of this name.
pub(crate) fn reply(hub: &Hub, name: &str) -> Reply {
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
