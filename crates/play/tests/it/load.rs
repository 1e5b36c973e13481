//! What pages cost the loop: nothing that is felt, however many there are and whatever they send.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use haptic::LoopReport;
use pegfit_play::Request;
use tungstenite::Message;

use crate::common::{PATIENCE, Theatre};

/// Of the deadlines of a loop, those left out: it shares the machine with other tests, and is late
/// where the system gives its thread no processor.
fn missed_share(report: &LoopReport) -> f64 {
    report.missed as f64 / (report.ticks + report.missed).max(1) as f64
}

/// A loop for a second while `work` goes on.
fn loop_beside(work: impl FnOnce(&Theatre)) -> LoopReport {
    let theatre = Theatre::open();
    let mut page = theatre.page();
    page.until(None, |seen| seen.ticks > 0);
    work(&theatre);
    page.until(None, |seen| seen.ticks > 1000);
    theatre.end().remove(0)
}

#[test]
fn ten_thousand_messages_a_second_are_refused_and_cost_no_ticks() {
    let quiet = loop_beside(|_| {});
    let flooded = loop_beside(|theatre| {
        let (began, mut sent, mut doors) = (Instant::now(), 0_u32, 0);
        let mut page = theatre.page();
        let nonsense = [Request::Take.bytes(), Request::Heartbeat.bytes()];
        while began.elapsed() < Duration::from_secs(1) {
            let due = (began.elapsed().as_secs_f64() * 1e4) as u32;
            while sent < due {
                let bytes = nonsense[usize::from(sent > 0)].clone();
                if page.socket.send(Message::binary(bytes)).is_err() {
                    // Shown the door; it tries again.
                    page = theatre.page();
                    doors += 1;
                }
                sent += 1;
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        assert!(
            doors > 0 && sent > 5000,
            "{sent} messages, {doors} times out"
        );
    });
    let [quiet, flooded] = [&quiet, &flooded].map(missed_share);
    // A tenth of a per cent more than without, and what two runs on a busy machine differ by.
    assert!(
        flooded < 3.0 * quiet + 0.05,
        "missed {flooded}, {quiet} without"
    );
}

/// A head that is never whole, a byte at a time, on one connection after another.
fn drip(theatre: &Theatre, done: &AtomicBool) {
    let head = format!(
        "GET /{}/ HTTP/1.1\r\nHost: {}\r\n",
        theatre.token, theatre.address
    );
    while !done.load(Ordering::Relaxed) {
        let Ok(mut stream) = TcpStream::connect(theatre.address) else {
            continue;
        };
        for byte in head.bytes().chain(std::iter::repeat(b'x')) {
            if done.load(Ordering::Relaxed) || stream.write_all(&[byte]).is_err() {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// Tells threads of an end, also of one by a failure.
struct Ending<'a>(&'a AtomicBool);

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn strangers_who_say_nothing_or_little_lock_nobody_out() {
    let report = loop_beside(|theatre| {
        let connect = || TcpStream::connect(theatre.address).unwrap();
        let mut idle: Vec<_> = (0..200).map(|_| connect()).collect();
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let _ending = Ending(&done);
            for _ in 0..8 {
                scope.spawn(|| drip(theatre, &done));
            }
            // At the first try, again and again, while others go on coming.
            for _ in 0..20 {
                idle.extend((0..10).map(|_| connect()));
                let reply = theatre.get("page.js");
                assert!(reply.starts_with("HTTP/1.1 200"), "{reply:.80}");
            }
            let mut owner = theatre.page();
            owner.press();
        });
    });
    assert!(report.ticks > 1000);
}

#[test]
fn strangers_are_few_and_do_not_stay() {
    let theatre = Theatre::open();
    let mut idle: Vec<_> = (0..200)
        .map(|_| TcpStream::connect(theatre.address).unwrap())
        .collect();
    // Those that had to make room, and those whose time is over, see an end.
    for stream in &mut idle {
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let said = stream.read(&mut [0; 16]);
        let over = |e: &std::io::Error| e.kind() == ErrorKind::ConnectionReset;
        assert!(
            matches!(&said, Ok(0)) || said.as_ref().is_err_and(over),
            "{said:?}"
        );
    }
}

/// Prints what `docs/play.md` states; run with `--nocapture`.
#[test]
fn frames_come_sixty_times_a_second_and_are_fresh() {
    let theatre = Theatre::open();
    let mut pages = [theatre.page(), theatre.page(), theatre.page()];
    pages[0].until(None, |seen| seen.ticks > 100);
    let done = AtomicBool::new(false);
    let (mut ages, mut seconds) = (Vec::new(), 0.0);
    std::thread::scope(|scope| {
        let [first, others @ ..] = &mut pages;
        for page in others {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    page.frame();
                }
            });
        }
        let began = Instant::now();
        for _ in 0..120 {
            let seen = first.frame();
            let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
            ages.push(1e3 * now.as_secs_f64() - seen.wall);
        }
        seconds = began.elapsed().as_secs_f64();
        done.store(true, Ordering::Relaxed);
    });
    ages.sort_by(f64::total_cmp);
    let rate = 120.0 / seconds;
    let (median, worst) = (ages[60], ages[118]);
    println!("{rate:.1} frames a second, {median:.2} ms old in the middle, {worst:.2} ms at 99 %");
    let report = theatre.end().remove(0);
    println!(
        "loop {:.1} Hz, computing p99 {:.0} µs, late p99 {:.0} µs, {} missed",
        report.rate_hz, report.latency_us.p99, report.lateness_us.p99, report.missed
    );
    // Half on a machine that does much else.
    assert!((30.0..70.0).contains(&rate), "{rate}");
    assert!(median < 30.0, "{median}");
}
