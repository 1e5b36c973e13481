//! The page: built from `page/` by `just page` and checked in.

use crate::server::http::Reply;

/// A file of the page.
pub(crate) fn asset(name: &str) -> Option<Reply> {
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
