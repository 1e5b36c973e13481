//! From a request's head to what it gets.

use crate::server::broadcaster::Broadcaster;
use crate::server::http::{Head, Reply};

/// A request that showed the key.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Visitor {
    /// What the browser calls this server.
    pub(crate) host: String,
    /// What is asked for, after the key.
    pub(crate) name: String,
    /// The key of a WebSocket, if one is asked for.
    pub(crate) socket_key: Option<String>,
}

/// Lets a request in, else says why it is refused.
pub(crate) fn authorize(broadcaster: &Broadcaster, head: Head) -> Result<Visitor, &'static str> {
    let access = &broadcaster.access;
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
    Ok(Visitor {
        name: name.to_owned(),
        socket_key: head.socket_key.filter(|_| name == "ws"),
        host: head.host,
    })
}

/// The file or message of this name.
pub(crate) fn reply(broadcaster: &Broadcaster, name: &str) -> Reply {
    if let Some(found) = asset(name) {
        return found;
    }
    let found = match name {
        "log.csv" => broadcaster
            .log()
            .map(|csv| Reply::ok("text/csv; charset=utf-8", csv)),
        name => (broadcaster.content())
            .and_then(|content| content.bytes(name))
            .map(|bytes| Reply::ok("application/octet-stream", bytes)),
    };
    found.unwrap_or_else(|| Reply::refused("404 Not Found"))
}

/// A file of the page.
fn asset(name: &str) -> Option<Reply> {
    Some(match name {
        "" => Reply::ok(
            "text/html; charset=utf-8",
            include_bytes!("../../page/dist/index.html"),
        ),
        "page.js" => Reply::ok(
            "text/javascript; charset=utf-8",
            include_bytes!("../../page/dist/page.js"),
        ),
        "worker.js" => Reply::ok(
            "text/javascript; charset=utf-8",
            include_bytes!("../../page/dist/worker.js"),
        ),
        "page.css" => Reply::ok(
            "text/css; charset=utf-8",
            include_bytes!("../../page/dist/page.css"),
        ),
        "licences.txt" => Reply::ok(
            "text/plain; charset=utf-8",
            include_bytes!("../../page/dist/licences.txt"),
        ),
        _ => return None,
    })
}
