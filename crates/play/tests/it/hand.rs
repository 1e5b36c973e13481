//! The hand: one page holds it, the others watch; it lets go when its page falls silent.

use std::time::{Duration, Instant};

use haptic::{Script, flags};
use pegfit_play::Request;

use crate::common::{Page, Theatre, over};

#[test]
fn one_page_holds_the_hand_and_the_others_watch() {
    let theatre = Theatre::open();
    let (mut first, mut second) = (theatre.page(), theatre.page());
    first.say(Request::Take);
    first.until(None, |seen| seen.is_hand && seen.pages == 2);
    second.until(None, |seen| seen.is_held && seen.pages == 2);
    second.say(Request::Take);
    // Whatever the second page asks for, the part stays with the first.
    let there = Request::Hold(over(0.05));
    first.until(Some(there), |seen| (seen.height - 0.05).abs() < 1e-3);
    for _ in 0..40 {
        second.say(Request::Hold(over(0.01)));
        second.say(Request::Place(over(0.01)));
        second.say(Request::Script(Script::Snap));
        second.say(Request::Choose(1));
        let seen = second.frame();
        assert!(!seen.is_hand && seen.is_held && seen.session == 1);
        first.say(there);
        assert!((first.frame().height - 0.05).abs() < 2e-3);
    }
    drop(first);
    second.until(None, |seen| !seen.is_held && seen.pages == 1);
    second.say(Request::Take);
    // Who takes the hand finds it where it was left.
    let taken = second.until(None, |seen| seen.is_hand);
    assert!((taken.height - 0.05).abs() < 2e-3, "{taken:?}");
    second.until(Some(Request::Hold(over(0.02))), |seen| {
        (seen.height - 0.02).abs() < 1e-3
    });
}

#[test]
fn a_wall_stops_the_part() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.press();
    for _ in 0..30 {
        page.say(Request::Hold(over(-0.02)));
        let seen = page.frame();
        // The coupling gives 1000 N/m at most 5 N; the wall gives way by less than 2 mm.
        assert!(seen.height > -0.003, "{seen:?}");
    }
}

#[test]
fn a_page_that_falls_silent_in_the_middle_of_a_push_lets_go() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    let pressed = page.press();
    assert_eq!(pressed.flags & flags::STALE, 0);
    let began = Instant::now();
    // It still watches: silence is not absence.
    let after = page.until(None, |seen| seen.force < 1e-3);
    assert_ne!(after.flags & flags::STALE, 0);
    assert!(after.is_hand);
    // 100 ms of silence, 10 ms of decay to 1/e; the rest for a machine that does much else.
    assert!(
        began.elapsed() < Duration::from_secs(2),
        "{:?}",
        began.elapsed()
    );
    page.press();
}

#[test]
fn a_page_that_is_closed_in_the_middle_of_a_push_lets_go() {
    let theatre = Theatre::open();
    let (mut hand, mut viewer) = (theatre.page(), theatre.page());
    hand.press();
    viewer.until(None, |seen| seen.force > 0.5 && seen.is_held);
    // As when a process dies: no goodbye.
    drop(hand);
    let after = viewer.until(None, |seen| seen.force < 1e-3);
    let still = viewer.until(None, |seen| seen.ticks > after.ticks + 200);
    assert!(!still.is_held && still.force == 0.0, "{still:?}");
    // And lies still.
    let later = viewer.until(None, |seen| seen.ticks > still.ticks + 200);
    assert!((later.height - still.height).abs() < 1e-6);
}

#[test]
fn what_is_recorded_can_be_fetched_and_replayed() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    assert_eq!(
        theatre
            .get("log.csv")
            .lines()
            .last()
            .unwrap()
            .split(',')
            .next(),
        Some("tick")
    );
    page.press();
    page.say(Request::Record(true));
    let push = Request::Hold(over(-0.02));
    page.until(Some(push), |seen| seen.recorded > 0.3);
    page.say(Request::Record(false));
    page.until(Some(Request::Hold(over(0.04))), |seen| {
        (seen.height - 0.04).abs() < 1e-3
    });
    let log = theatre.get("log.csv");
    assert!(log.starts_with("HTTP/1.1 200 OK") && log.lines().count() > 200);
    page.say(Request::Replay);
    // Pressed again, by the tape.
    page.until(Some(Request::Heartbeat), |seen| seen.force > 1.0);
}

#[test]
fn a_recording_ends_with_its_page() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.say(Request::Take);
    page.say(Request::Record(true));
    page.until(Some(Request::Heartbeat), |seen| seen.recorded > 0.1);
    drop(page);
    let mut viewer = theatre.page();
    let end = viewer.until(None, |seen| !seen.is_held);
    let later = viewer.until(None, |seen| seen.ticks > end.ticks + 200);
    assert!(
        end.recorded > 0.1 && later.recorded == end.recorded,
        "{later:?}"
    );
}

#[test]
fn another_pair_is_another_stage() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.say(Request::Take);
    page.until(None, |seen| seen.is_hand && seen.session == 1);
    // There is no such pair; this one is on the session already.
    page.say(Request::Choose(7));
    page.say(Request::Choose(0));
    page.say(Request::Choose(1));
    let second = page.until(None, |seen| seen.session == 2);
    assert!(
        second.is_hand && (second.height - 0.04).abs() < 1e-3,
        "{second:?}"
    );
    // The frame may come before the words.
    let told = |page: &Page| page.texts.iter().any(|text| text.contains("\"stage\":2"));
    while !told(&page) {
        page.frame();
    }
    let reports = theatre.end();
    assert_eq!(reports.len(), 2);
}

#[test]
fn scripts_run_until_they_are_stopped() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.say(Request::Take);
    page.say(Request::Script(Script::Collision));
    page.until(Some(Request::Heartbeat), |seen| seen.force > 0.5);
    page.until(Some(Request::Hold(over(0.05))), |seen| {
        (seen.height - 0.05).abs() < 1e-3
    });
}

#[test]
fn the_hand_follows_the_way_in_slowly_and_the_wall_stops_it() {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.say(Request::Take);
    page.until(Some(Request::Hold(over(0.06))), |seen| {
        (seen.height - 0.06).abs() < 1e-3
    });
    assert!(page.texts.iter().any(|text| text.contains("\"path\":true")));
    page.say(Request::Follow);
    let began = page.until(Some(Request::Heartbeat), |seen| {
        (seen.height - 0.02).abs() < 1e-4
    });
    let halfway = page.until(Some(Request::Heartbeat), |seen| seen.height < 0.01);
    // A second of rest, then 10 mm at 20 mm/s.
    assert!(halfway.wall - began.wall > 1000.0, "{began:?} {halfway:?}");
    let stopped = page.until(Some(Request::Heartbeat), |seen| seen.force > 1.0);
    assert!(stopped.height > -0.003, "{stopped:?}");
    // The other pair has no path: nothing happens.
    page.say(Request::Choose(1));
    page.until(Some(Request::Heartbeat), |seen| seen.session == 2);
    page.until(Some(Request::Hold(over(0.06))), |seen| {
        (seen.height - 0.06).abs() < 1e-3
    });
    let before = page.frame().ticks;
    page.say(Request::Follow);
    let after = page.until(Some(Request::Heartbeat), |seen| seen.ticks > before + 500);
    assert!((after.height - 0.06).abs() < 1e-3, "{after:?}");
    assert!(
        page.texts
            .iter()
            .any(|text| text.contains("\"path\":false"))
    );
}
