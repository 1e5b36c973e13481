//! `pegfit play`: a page with what belongs to it, until Ctrl-C; the server's own tests are in
//! `pegfit-play`, those in a browser in `tests/play`.
#![cfg(unix)]

use std::fs::Permissions;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{pegfit, refuse, scene_folder, stderr, succeed};

struct Play {
    child: Child,
    address: String,
    path: String,
}

impl Play {
    /// Started in `folder`, its page's address read.
    fn start(folder: &Path, words: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pegfit"));
        command
            .current_dir(folder)
            .args(["play", "--no-open", "--json", "-q"])
            .args(words);
        Self::run(command)
    }

    fn run(mut command: Command) -> Self {
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut said = BufReader::new(child.stdout.as_mut().unwrap());
        said.read_line(&mut line).unwrap();
        let said: serde_json::Value = serde_json::from_str(&line).unwrap();
        let url = said["url"]
            .as_str()
            .unwrap()
            .strip_prefix("http://")
            .unwrap();
        let (address, path) = url.split_once('/').unwrap();
        Self {
            address: address.to_owned(),
            path: format!("/{path}"),
            child,
        }
    }

    /// A reply's status and body.
    fn get(&self, name: &str) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        let request = format!(
            "GET {}{name} HTTP/1.1\r\nHost: {}\r\n\r\n",
            self.path, self.address
        );
        stream.write_all(request.as_bytes()).unwrap();
        let mut reply = Vec::new();
        stream.read_to_end(&mut reply).unwrap();
        let end = reply
            .windows(4)
            .position(|four| four == b"\r\n\r\n")
            .unwrap();
        let status = std::str::from_utf8(&reply[9..12]).unwrap().parse().unwrap();
        (status, reply[end + 4..].to_vec())
    }

    /// What a stage shows, once there is one.
    fn shown(&self, name: &str) -> Vec<u8> {
        let began = Instant::now();
        loop {
            let (status, body) = self.get(name);
            if status == 200 {
                return body;
            }
            assert!(
                began.elapsed() < Duration::from_secs(60),
                "{name}: {status}"
            );
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ctrl-C; the exit code.
    fn end(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-INT", &id])
                .status()
                .unwrap()
                .success()
        );
        self.child.wait().unwrap().code()
    }
}

impl Drop for Play {
    /// A test that fails leaves no server behind; one that has ended cannot be killed.
    fn drop(&mut self) {
        let _ = self.child.kill();
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

#[test]
fn a_scene_is_served_until_ctrl_c() {
    let folder = scene_folder("");
    let play = Play::start(folder.path(), &["scene.toml"]);
    let (status, page) = play.get("");
    assert!(status == 200 && page.starts_with(b"<!doctype html>"));
    let (hole, peg) = (play.shown("mesh/0"), play.shown("mesh/moving"));
    assert_eq!([word(&hole, 4), word(&peg, 4)], [32, 12]);
    for part in ["0", "moving"] {
        let slice = play.shown(&format!("slice/{part}"));
        let (columns, rows) = (word(&slice, 0) as usize, word(&slice, 4) as usize);
        assert_eq!(slice.len(), 44 + 4 * columns * rows);
        let values = slice[44..]
            .chunks_exact(4)
            .map(|four| f32::from_le_bytes(four.try_into().unwrap()));
        let (least, most) = values.fold((0.0_f32, 0.0_f32), |(a, b), v| (a.min(v), b.max(v)));
        assert!(least < -0.1 && most > 0.1, "{part}: {least} to {most}");
        let skeleton = play.shown(&format!("skeleton/{part}"));
        assert!(
            skeleton.len() > 16 && skeleton.len().is_multiple_of(16),
            "{part}"
        );
    }
    for nothing in ["mesh/1", "mesh/-1", "slice/1", "mesh/..", "scene.toml"] {
        assert_eq!(play.get(nothing).0, 404, "{nothing}");
    }
    assert_eq!(play.end(), Some(0));
}

#[test]
fn without_a_scene_it_plays_the_papers_pairs() {
    let folder = tempfile::tempdir().unwrap();
    let play = Play::start(folder.path(), &[]);
    assert!(word(&play.shown("mesh/0"), 4) > 8);
    assert_eq!(play.end(), Some(0));
    // What it made is gone.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A program that writes down its name and words, and waits.
fn fake_browser(program: &Path) {
    let said = program.with_extension("said");
    let said = said.display();
    let script = format!(
        "#!/bin/sh\nprintf '%s\\n' \"$0\" \"$@\" > '{said}.part'\nmv '{said}.part' '{said}'\n"
    );
    std::fs::write(program, script).unwrap();
    std::fs::set_permissions(program, Permissions::from_mode(0o700)).unwrap();
}

/// The words with which a fake browser was started.
fn started(program: &Path) -> String {
    let began = Instant::now();
    loop {
        if let Ok(said) = std::fs::read_to_string(program.with_extension("said")) {
            return said;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "no browser");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Runs `pegfit play`, which opens `program` with the environment so set; its files belong into
/// `home`.
fn opens(program: &Path, home: &Path, set: &[(&str, &Path)]) {
    fake_browser(program);
    let scene = scene_folder("");
    let mut command = Command::new(env!("CARGO_BIN_EXE_pegfit"));
    command.current_dir(scene.path());
    command.args(["play", "scene.toml", "--json", "-q"]);
    command.env_remove("BROWSER").env_remove("XDG_RUNTIME_DIR");
    command.envs(set.iter().copied());
    let play = Play::run(command);
    let key = play.path.trim_matches('/').to_owned();
    assert_eq!(key.len(), 32);
    // What every user of the machine can read has no key in it.
    let words = started(program);
    assert!(!words.contains(&key), "{words}");
    let own = std::fs::read(format!("/proc/{}/cmdline", play.child.id())).unwrap_or_default();
    assert!(!String::from_utf8_lossy(&own).contains(&key));
    // What only this user can read leads there.
    let file = Path::new(words.lines().last().unwrap()).to_owned();
    assert!(file.starts_with(home), "{words}");
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!((mode(&file), mode(file.parent().unwrap())), (0o600, 0o700));
    let text = std::fs::read_to_string(&file).unwrap();
    let (_, url) = text.split_once("content=\"0; url=").unwrap();
    let (url, _) = url.split_once('"').unwrap();
    assert_eq!(url, format!("http://{}{}", play.address, play.path));
    assert_eq!(play.get("").0, 200);
    // Ended while it loads the parts it would say that it was interrupted.
    play.shown("mesh/0");
    assert_eq!(play.end(), Some(0));
    assert!(!file.exists() && !file.parent().unwrap().exists());
}

#[test]
fn a_browser_is_shown_the_way_by_a_file_that_nobody_else_reads() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str| {
        let made = folder.path().join(name);
        std::fs::create_dir(&made).unwrap();
        made
    };
    let (runtime, temporary, programs) = (made("runtime"), made("temporary"), made("programs"));
    let preferred = folder.path().join("browser");
    let set = [
        ("BROWSER", preferred.as_path()),
        ("XDG_RUNTIME_DIR", &runtime),
    ];
    opens(&preferred, &runtime, &set);
    // The system's own, where there is no runtime folder.
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else {
        "xdg-open"
    };
    let system = programs.join(opener);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths([programs].into_iter().chain(std::env::split_paths(&path)));
    let (path, nowhere) = (path.unwrap(), folder.path().join("nowhere"));
    let set = [
        ("PATH", Path::new(&path)),
        ("XDG_RUNTIME_DIR", &nowhere),
        ("TMPDIR", &temporary),
    ];
    opens(&system, &temporary, &set);
}

#[test]
fn what_cannot_be_served_is_refused_with_a_reason() {
    let folder = scene_folder("");
    refuse(folder.path(), &["play", "--table", "t.zarr"]);
    refuse(folder.path(), &["play", "no-such-scene.toml"]);
    refuse(
        folder.path(),
        &["play", "scene.toml", "--bind", "somewhere"],
    );
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let output = pegfit(
        folder.path(),
        &["play", "scene.toml", "--no-open", "--port", &port],
    );
    assert_eq!(output.status.code(), Some(1));
    let told = stderr(&output);
    assert!(told.contains("cannot listen on 127.0.0.1:"), "{told}");
}

#[test]
fn a_way_that_is_none_is_refused_by_its_file() {
    let folder = scene_folder("");
    let refused = |text: &str| {
        std::fs::write(folder.path().join("way.csv"), text).unwrap();
        refuse(
            folder.path(),
            &["play", "scene.toml", "--no-open", "--path", "way.csv"],
        )
    };
    let one = "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n";
    let said = refused(one);
    assert!(said.contains("way.csv") && said.contains("2 to"), "{said}");
    let said = refused(&format!("{one}0,0,up,0,0,0,1\n"));
    assert!(
        said.contains("way.csv: row 2, column z") && said.contains("up"),
        "{said}"
    );
    let said = refused("tick,time\n");
    assert!(said.contains("way.csv: header"), "{said}");
    refuse(
        folder.path(),
        &["play", "scene.toml", "--no-open", "--way", "no.csv"],
    );
    // Whose way would it be?
    refuse(folder.path(), &["play", "--no-open", "--way", "way.csv"]);
}

#[test]
fn a_path_that_was_found_can_be_followed() {
    let folder = scene_folder("");
    succeed(
        folder.path(),
        &[
            "path",
            "scene.toml",
            "--solids-only",
            "-o",
            "path.csv",
            "-q",
        ],
    );
    let play = Play::start(folder.path(), &["scene.toml", "--path", "path.csv"]);
    let (origin, path) = (
        format!("http://{}", play.address),
        format!("{}ws", play.path),
    );
    // The loop runs once there is something to be seen.
    play.shown("mesh/0");
    let mut stream = TcpStream::connect(&play.address).unwrap();
    let request = format!(
        "GET {path} HTTP/1.1\r\nHost: {}\r\nOrigin: {origin}\r\nUpgrade: websocket\r\n\
         Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
        play.address
    );
    stream.write_all(request.as_bytes()).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(20)))
        .unwrap();
    let (mut said, mut piece) = (Vec::new(), [0; 4096]);
    let words = b"\"path\":true";
    while !said.windows(words.len()).any(|w| w == words) {
        let count = stream.read(&mut piece).unwrap();
        assert!(count > 0, "{}", String::from_utf8_lossy(&said));
        said.extend(&piece[..count]);
    }
    drop(stream);
    assert_eq!(play.end(), Some(0));
}
