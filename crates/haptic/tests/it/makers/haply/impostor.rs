//! Whatever else may listen on the service's port: nobody waits for it for ever.

use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use haptic::device::haply::{InverseOptions, find, open};
use tungstenite::{Message, accept};

/// Longer than any look takes on a machine that does much else.
const PATIENCE: Duration = Duration::from_secs(60);

/// What it does with a connection until that ends.
type Manner = fn(TcpStream) -> Option<()>;

/// Why there is no device where something behaves like that. Fails if that is not told at all.
fn told(manner: Manner) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let options = InverseOptions {
        address: listener.local_addr().unwrap(),
        id: None,
    };
    // It waits for connections until the test program ends.
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            std::thread::spawn(move || manner(stream));
        }
    });
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let looked = find(&options).unwrap_err().to_string();
        // To open one ends, too.
        assert!(open(options).is_err());
        sender.send(looked)
    });
    match receiver.recv_timeout(PATIENCE) {
        Ok(told) => told,
        Err(RecvTimeoutError::Timeout) => panic!("it is still waited for"),
        Err(RecvTimeoutError::Disconnected) => panic!("see above"),
    }
}

/// Says `bytes` for ever, `pause` apart, until nobody listens.
fn repeat(stream: &mut TcpStream, bytes: &[u8], pause: Duration) -> Option<()> {
    loop {
        stream.write_all(bytes).ok()?;
        std::thread::sleep(pause);
    }
}

/// The end of what is waited for, which a busy machine may come to first.
const LATE: &str = "has not said within 2s";

const SLOWLY: Duration = Duration::from_millis(50);
const FAST: Duration = Duration::ZERO;

/// Shakes hands, then says `first`, and `bytes` for ever.
fn after_hands(stream: TcpStream, first: &[u8], bytes: &[u8], pause: Duration) -> Option<()> {
    let mut socket = accept(stream).ok()?;
    socket.get_mut().write_all(first).ok()?;
    repeat(socket.get_mut(), bytes, pause)
}

/// Shakes hands, says this, and waits.
fn one(stream: TcpStream, message: Message) -> Option<()> {
    let mut socket = accept(stream).ok()?;
    socket.send(message).ok()?;
    socket.read().ok().map(drop)
}

#[test]
fn one_that_says_nothing_or_little_at_a_time_is_told_of_in_time() {
    const MANNERS: [(&str, Manner); 6] = [
        ("takes the connection and waits", |s| {
            std::thread::sleep(PATIENCE);
            drop(s);
            Some(())
        }),
        ("a byte of its head now and then", |mut s| {
            s.write_all(b"HTTP/1.1 101 Switching Protocols\r\nX: ")
                .ok()?;
            repeat(&mut s, b"x", SLOWLY)
        }),
        ("shakes hands and waits", |s| {
            let _socket = accept(s).ok()?;
            std::thread::sleep(PATIENCE);
            Some(())
        }),
        // A text of 65000 bytes.
        ("a byte of its message now and then", |s| {
            after_hands(s, &[0x81, 126, 0xfd, 0xe8], b"x", SLOWLY)
        }),
        ("a ping now and then", |s| {
            after_hands(s, &[], &[0x89, 0], SLOWLY)
        }),
        ("pieces of nothing for ever", |s| {
            after_hands(s, &[0x01, 0], &[0x00, 0], FAST)
        }),
    ];
    for (what, manner) in MANNERS {
        let told = told(manner);
        assert!(told.contains(LATE), "{what}: {told}");
    }
}

#[test]
fn one_that_says_too_much_is_refused() {
    const MANNERS: [(&str, Manner, &str); 6] = [
        (
            "header lines for ever",
            |mut s| {
                s.write_all(b"HTTP/1.1 101 Switching Protocols\r\n").ok()?;
                repeat(
                    &mut s,
                    b"X-Filler: 0123456789012345678901234567890123456789\r\n",
                    FAST,
                )
            },
            "expected the JSON",
        ),
        (
            "a frame of 2^62 bytes",
            |s| {
                after_hands(
                    s,
                    &[0x81, 127, 0x40, 0, 0, 0, 0, 0, 0, 0],
                    &[b'x'; 4096],
                    FAST,
                )
            },
            "too long",
        ),
        (
            "a message without end",
            |s| {
                let piece = [&[0x00, 126, 0x10, 0x00][..], &[b'x'; 4096]].concat();
                after_hands(s, &[0x01, 0], &piece, FAST)
            },
            "too long",
        ),
        (
            "messages for ever",
            |s| after_hands(s, &[], b"\x81\x02no", FAST),
            "expected the JSON",
        ),
        (
            "ten thousand devices",
            |s| one(s, Message::text(arms("049D", 10_000))),
            "10000 devices of a kind",
        ),
        (
            "a name that a terminal obeys",
            |s| one(s, Message::text(arms("\\u001b[2J\\u202e", 1))),
            r"a device called",
        ),
    ];
    for (what, manner, words) in MANNERS {
        let told = told(manner);
        let lower = told.to_lowercase();
        let late = told.contains(LATE);
        assert!(
            late || lower.contains(&words.to_lowercase()),
            "{what}: {told}"
        );
        assert!(
            told.len() < 1000 && !told.contains(char::is_control),
            "{what}: {told:?}"
        );
    }
}

#[test]
fn a_wrong_answer_is_told_in_few_words() {
    let told = told(|s| {
        let long = "x".repeat(500_000);
        one(s, Message::text(format!("{{\"inverse3\": \"{long}\"}}")))
    });
    assert!(
        told.contains("expected the JSON") && told.len() < 1000,
        "{told}"
    );
}

/// The state of as many arms of this id.
fn arms(id: &str, count: usize) -> String {
    let arm = format!("{{\"device_id\": \"{id}\"}}");
    format!("{{\"inverse3\": [{}]}}", vec![arm; count].join(","))
}
