//! Who comes in: the right token, a host and an origin of this server, requests that are some.

use std::io::Write;

use pegfit_play::Request;
use tungstenite::Message;
use tungstenite::protocol::frame::coding::CloseCode;

use crate::common::{Page, Theatre};

#[test]
fn the_page_and_what_belongs_to_it_are_there_with_the_token() {
    let theatre = Theatre::open();
    for (name, kind, holds) in [
        ("", "text/html", "page.js"),
        ("page.js", "text/javascript", "worker.js"),
        ("worker.js", "text/javascript", "WebSocket"),
        ("page.css", "text/css", "#stage"),
        ("licences.txt", "text/plain", "MIT"),
    ] {
        let reply = theatre.get(name);
        assert!(reply.starts_with("HTTP/1.1 200 OK\r\n"), "{name}");
        let (head, body) = reply.split_once("\r\n\r\n").unwrap();
        assert!(head.contains(&format!("Content-Type: {kind}")), "{head}");
        for line in [
            "Content-Security-Policy: default-src 'none'; script-src 'self';",
            "frame-ancestors 'none'",
            "X-Content-Type-Options: nosniff",
            "Referrer-Policy: no-referrer",
        ] {
            assert!(head.contains(line), "{name}: {line}");
        }
        assert!(body.contains(holds), "{name}");
    }
    assert!(theatre.get("mesh/0").starts_with("HTTP/1.1 404"));
    assert!(theatre.url.starts_with("http://127.0.0.1:"));
}

#[test]
fn whoever_lacks_the_token_or_comes_under_another_name_is_refused() {
    let theatre = Theatre::open();
    let (address, token) = (theatre.address, theatre.token.clone());
    let port = address.port();
    let status = |request: &str| theatre.ask(request)[9..12].to_owned();
    let get =
        |path: &str, host: &str| status(&format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    let own = address.to_string();
    assert_eq!(get(&format!("/{token}/"), &own), "200");
    assert_eq!(
        get(&format!("/{token}/"), &format!("localhost:{port}")),
        "200"
    );
    for path in [
        "/",
        "/index.html",
        "/00000000000000000000000000000000/",
        "/../etc/passwd",
    ] {
        assert_eq!(get(path, &own), "404", "{path}");
    }
    for host in [
        "evil.example",
        &format!("evil.example:{port}"),
        "127.0.0.1",
        "",
    ] {
        assert_eq!(get(&format!("/{token}/"), host), "421", "{host}");
    }
    let foreign = format!(
        "GET /{token}/page.js HTTP/1.1\r\nHost: {own}\r\nOrigin: http://evil.example\r\n\r\n"
    );
    assert_eq!(status(&foreign), "403");
    assert_eq!(
        status(&format!("POST /{token}/ HTTP/1.1\r\nHost: {own}\r\n\r\n")),
        "405"
    );
    for garbage in ["\r\n\r\n", "GET\r\n\r\n", "\x16\x03\x01\x02\r\n\r\n"] {
        assert_eq!(status(garbage), "400", "{garbage:?}");
    }
}

#[test]
fn sockets_need_the_token_and_the_page_as_their_origin() {
    let theatre = Theatre::open();
    let own = format!("http://{}", theatre.address);
    let open = |token: &str, origin: Option<&str>| Page::open(&theatre, token, origin).err();
    assert_eq!(open(&theatre.token, Some(&own)), None);
    assert_eq!(open(&"0".repeat(32), Some(&own)), Some(404));
    let mut short = theatre.token.clone();
    short.pop();
    assert_eq!(open(&short, Some(&own)), Some(404));
    for origin in [
        None,
        Some("null"),
        Some("http://evil.example"),
        Some("http://127.0.0.1:1"),
        Some("file://"),
    ] {
        assert_eq!(open(&theatre.token, origin), Some(403), "{origin:?}");
    }
}

#[test]
fn a_page_that_talks_nonsense_is_shown_the_door() {
    let theatre = Theatre::open();
    for (message, code) in [
        (Message::binary(vec![200]), CloseCode::Unsupported),
        (Message::binary(Vec::new()), CloseCode::Unsupported),
        (Message::binary(vec![1; 20]), CloseCode::Unsupported),
        (Message::text("{\"hold\":1}"), CloseCode::Unsupported),
        (Message::binary(vec![0; 65]), CloseCode::Size),
        (Message::binary(vec![0; 100_000]), CloseCode::Size),
    ] {
        let mut page = theatre.page();
        page.frame();
        page.socket.send(message).unwrap();
        // A page that was cut off while it still sent may not hear the code.
        let heard = page.dismissed();
        assert!(heard.is_none_or(|heard| heard == code), "{heard:?}");
    }
    let mut page = theatre.page();
    page.say(Request::Take);
    page.until(None, |seen| seen.is_hand);
}

/// A frame as a browser sends it, masked by nothing.
fn frame(first: u8, bytes: &[u8]) -> Vec<u8> {
    let length = 0x80 | u8::try_from(bytes.len()).unwrap();
    [&[first, length, 0, 0, 0, 0], bytes].concat()
}

/// The last of a message's frames.
const LAST: u8 = 0x80;
const BINARY: u8 = 0x02;
const MORE: u8 = 0x00;
const PING: u8 = 0x09;

#[test]
fn a_page_that_sends_endless_empty_frames_is_shown_the_door() {
    let theatre = Theatre::open();
    for (first, next) in [
        (BINARY, MORE),
        (LAST | PING, LAST | PING),
        // A piece of a message, then pings for ever.
        (BINARY, LAST | PING),
    ] {
        let mut page = theatre.page();
        page.frame();
        let stream = page.socket.get_mut();
        stream.write_all(&frame(first, &[])).unwrap();
        for _ in 0..2000 {
            // A page that is cut off cannot go on.
            if stream.write_all(&frame(next, &[])).is_err() {
                break;
            }
        }
        let heard = page.dismissed();
        assert!(
            heard.is_none_or(|code| code == CloseCode::Policy),
            "{heard:?}"
        );
    }
}

#[test]
fn a_message_may_come_in_pieces() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.frame();
    let take = Request::Take.bytes();
    for bytes in [
        frame(BINARY, &[]),
        frame(MORE, &take),
        frame(LAST | MORE, &[]),
    ] {
        page.socket.get_mut().write_all(&bytes).unwrap();
    }
    page.until(None, |seen| seen.is_hand);
}

#[test]
fn a_page_that_is_against_the_protocol_is_shown_the_door() {
    let theatre = Theatre::open();
    for bytes in [
        // Without a mask; an extension's bit; a piece of nothing; a message within another.
        vec![LAST | BINARY, 1, 0],
        frame(LAST | 0x40 | BINARY, &[0]),
        frame(LAST | MORE, &[0]),
        [frame(BINARY, &[0]), frame(LAST | BINARY, &[0])].concat(),
        // A kind of frame that nobody has defined.
        frame(LAST | 0x03, &[0]),
    ] {
        let mut page = theatre.page();
        page.frame();
        page.socket.get_mut().write_all(&bytes).unwrap();
        let heard = page.dismissed();
        assert!(
            heard.is_none_or(|code| code == CloseCode::Protocol),
            "{bytes:?}: {heard:?}"
        );
    }
}

#[test]
fn a_page_is_greeted_with_the_pairs_and_the_stage() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    let first = page.frame();
    assert_eq!(first.session, 1);
    assert!(
        page.texts[0].contains("\"pairs\":[\"one\",\"two\"]"),
        "{:?}",
        page.texts
    );
    assert!(
        page.texts.iter().any(|text| text.contains("\"stage\":1")),
        "{:?}",
        page.texts
    );
}
