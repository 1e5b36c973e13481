//! As much of HTTP as a page needs: one request per connection, no body; replies with headers that
//! keep a browser from doing anything else with them.

use std::io::Write;

/// Most bytes of a request's head.
const MAX_HEAD_BYTES: usize = 8192;

/// Most header lines.
const LINES: usize = 64;

/// The head of a request.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Head {
    pub(crate) method: String,
    pub(crate) path: String,
    pub(crate) host: String,
    pub(crate) origin: Option<String>,
    /// The key of a request for a WebSocket, if it is one.
    pub(crate) socket_key: Option<String>,
}

/// The state of a request head.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum HeadState {
    /// It may become a head.
    More,
    /// A head. What follows it is lost: nobody sends more before the reply.
    Head(Head),
    /// It is none, or too long.
    Invalid,
    /// Nothing more will come.
    Gone,
}

/// Reads what has come of a head, of which the first `known` bytes were not the whole of one.
pub(crate) fn read(bytes: &[u8], known: usize) -> HeadState {
    if bytes.len() > MAX_HEAD_BYTES {
        return HeadState::Invalid;
    }
    // Its end may have begun in what is known.
    let new = &bytes[known.saturating_sub(3)..];
    if new.windows(4).any(|four| four == b"\r\n\r\n") {
        return parse(bytes).map_or(HeadState::Invalid, HeadState::Head);
    }
    HeadState::More
}

fn parse(bytes: &[u8]) -> Option<Head> {
    let mut lines = [httparse::EMPTY_HEADER; LINES];
    let mut request = httparse::Request::new(&mut lines);
    if !request.parse(bytes).ok()?.is_complete() {
        return None;
    }
    let mut head = Head {
        method: request.method?.to_owned(),
        path: request.path?.to_owned(),
        ..Head::default()
    };
    let (mut upgrade, mut key, mut hosts) = (false, None, 0);
    for line in request.headers.iter() {
        let value = std::str::from_utf8(line.value).ok()?.trim();
        match line.name.to_ascii_lowercase().as_str() {
            "host" => {
                hosts += 1;
                value.clone_into(&mut head.host);
            }
            "origin" => head.origin = Some(value.to_owned()),
            "upgrade" => upgrade = value.eq_ignore_ascii_case("websocket"),
            "sec-websocket-key" => key = Some(value.to_owned()),
            _ => {}
        }
    }
    head.socket_key = key.filter(|_| upgrade);
    (hosts == 1).then_some(head)
}

/// A reply to a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Reply {
    pub(crate) status: &'static str,
    pub(crate) kind: &'static str,
    pub(crate) body: Vec<u8>,
}

impl Reply {
    pub(crate) fn ok(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status: "200 OK",
            kind,
            body: body.into(),
        }
    }

    /// A refusal in a word.
    pub(crate) fn refused(status: &'static str) -> Self {
        Self {
            status,
            kind: "text/plain; charset=utf-8",
            body: format!("{status}\n").into_bytes(),
        }
    }

    /// Writes it; `policy` is the content security policy.
    pub(crate) fn write(&self, policy: &str, out: &mut impl Write) -> std::io::Result<()> {
        let head = format!(
            "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\n\
             Content-Security-Policy: {policy}\r\nX-Content-Type-Options: nosniff\r\n\
             Referrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n\
             Cache-Control: no-store\r\nConnection: close\r\n\r\n",
            self.status,
            self.kind,
            self.body.len()
        );
        out.write_all(head.as_bytes())?;
        out.write_all(&self.body)?;
        out.flush()
    }
}

/// Nothing but what this server sends; `host` is what the browser calls it.
pub(crate) fn policy(host: &str, embed: bool) -> String {
    let frames = match embed {
        true => "http://localhost:* http://127.0.0.1:* vscode-webview:",
        false => "'none'",
    };
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
         connect-src 'self' ws://{host}; worker-src 'self'; base-uri 'none'; form-action 'none'; \
         frame-ancestors {frames}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(text: &str) -> Option<Head> {
        match read(text.as_bytes(), 0) {
            HeadState::Head(head) => Some(head),
            _ => None,
        }
    }

    #[test]
    fn heads_are_read() {
        let found = head(
            "GET /t/ws HTTP/1.1\r\nHost: localhost:9\r\nOrigin: http://localhost:9\r\n\
             Upgrade: WebSocket\r\nSec-WebSocket-Key: abc\r\n\r\n",
        )
        .unwrap();
        assert_eq!(
            (found.method.as_str(), found.path.as_str()),
            ("GET", "/t/ws")
        );
        assert_eq!(found.host, "localhost:9");
        assert_eq!(found.origin.as_deref(), Some("http://localhost:9"));
        assert_eq!(found.socket_key.as_deref(), Some("abc"));
        let plain = head("GET / HTTP/1.1\r\nhost: a\r\nSec-WebSocket-Key: abc\r\n\r\n").unwrap();
        assert_eq!(plain.socket_key, None);
    }

    #[test]
    fn anything_else_is_nothing() {
        let long = format!(
            "GET / HTTP/1.1\r\nHost: a\r\nX: {}\r\n\r\n",
            "x".repeat(MAX_HEAD_BYTES)
        );
        for bad in [
            "",
            "GET / HTTP/1.1\r\nHost: a\r\n",
            "GET / HTTP/1.1\r\n\r\n",
            "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
            "\x16\x03\x01\r\n\r\n",
            "GET /\r\n\r\n",
            &long,
        ] {
            assert_eq!(head(bad), None);
        }
        assert_eq!(read(long.as_bytes(), 0), HeadState::Invalid);
    }

    #[test]
    fn a_head_may_come_in_any_pieces() {
        let whole = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n";
        for known in 0..whole.len() {
            assert_eq!(
                read(&whole[..known], known.saturating_sub(1)),
                HeadState::More
            );
            assert!(matches!(read(whole, known), HeadState::Head(_)), "{known}");
        }
    }

    #[test]
    fn replies_say_what_a_browser_may_do() {
        let mut out = Vec::new();
        let policy = policy("localhost:9", false);
        Reply::ok("text/html", "<p>")
            .write(&policy, &mut out)
            .unwrap();
        let text = String::from_utf8(out).unwrap();
        assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.ends_with("\r\n\r\n<p>"));
        for line in [
            "default-src 'none'",
            "nosniff",
            "no-referrer",
            "Content-Length: 3\r\n",
        ] {
            assert!(text.contains(line), "{line}");
        }
    }
}
