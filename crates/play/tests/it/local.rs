//! A session whose page is in the same program: without a server, a thread or a socket.

use std::sync::Arc;
use std::time::Instant;

use pegfit_play::{LocalSession, Request};

use crate::common::{Seen, Wall, over, session};

/// Steps until what a page sees is as wanted, with a heartbeat in each step.
fn until(local: &mut LocalSession, what: &str, test: impl Fn(&Seen) -> bool) -> Seen {
    let began = Instant::now();
    loop {
        while !local.step() {}
        local.handle(&Request::Heartbeat.bytes());
        let seen = Seen::read(&local.frame().unwrap());
        if test(&seen) {
            return seen;
        }
        assert!(
            began.elapsed() < crate::common::PATIENCE,
            "{what}: {seen:?}"
        );
    }
}

#[test]
fn a_page_in_the_same_program_pushes_records_and_replays() {
    let session = session(0.03);
    let mut local = LocalSession::new(&session, Arc::new(Wall), 3, 1).unwrap();
    assert!(local.frame().is_none(), "before the first tick");
    let said = local.description();
    assert_eq!((&said["stage"], &said["pair"]), (&3.into(), &1.into()));
    assert_eq!(said["path"], true);

    let first = until(&mut local, "the first frame", |seen| seen.ticks > 0);
    assert!(first.is_hand && first.is_held && first.pages == 1 && first.session == 3);
    assert!((first.height - 0.03).abs() < 1e-3, "{first:?}");

    // Into the wall, which pushes back.
    assert!(local.handle(&Request::Record(true).bytes()));
    assert!(local.handle(&Request::Hold(over(-0.02)).bytes()));
    let pushed = until(&mut local, "the wall", |seen| seen.force > 1.0);
    assert!(pushed.height < 1e-3 && pushed.height > -0.01, "{pushed:?}");
    assert!(local.handle(&Request::Record(false).bytes()));
    let taped = until(&mut local, "the recording", |seen| seen.recorded > 0.0);
    let log = String::from_utf8(local.bytes("log.csv").unwrap()).unwrap();
    let rows = log.lines().count() - 1;
    // A sample a tick that was not too late, in as many milliseconds and one.
    assert!(
        rows > 10 && rows as f64 <= 1e3 * taped.recorded + 2.0,
        "{rows}"
    );

    assert!(
        !local.handle(&[250, 1, 2]) && !local.handle(&[]),
        "no request"
    );
    assert!(local.bytes("mesh/0").is_none());
    assert_eq!(local.dock()["failed"], "there is nothing to look for");
}

/// A page that says nothing any more lets go.
#[test]
fn silence_lets_go() {
    let session = session(0.03);
    let stale = session.config.stale_s;
    let mut local = LocalSession::new(&session, Arc::new(Wall), 1, 0).unwrap();
    local.handle(&Request::Hold(over(-0.02)).bytes());
    until(&mut local, "the wall", |seen| seen.force > 1.0);
    let began = Instant::now();
    while began.elapsed().as_secs_f64() < 3.0 * stale {
        local.step();
    }
    let seen = Seen::read(&local.frame().unwrap());
    assert_eq!(seen.force, 0.0, "{seen:?}");
    assert_ne!(seen.flags & haptic::flags::STALE, 0);
}
