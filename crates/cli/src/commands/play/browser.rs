//! Opening a browser.

use std::process::{Command, Stdio};

/// Asks the system to show an address; true if it took the question.
pub(super) fn open(url: &str) -> bool {
    let mut command = if cfg!(target_os = "macos") {
        Command::new("open")
    } else if cfg!(target_os = "windows") {
        Command::new("explorer")
    } else {
        Command::new("xdg-open")
    };
    let quiet = command
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let Ok(mut child) = quiet.spawn() else {
        return false;
    };
    // Some browsers stay in the foreground; the thread ends with them or with the program.
    std::thread::spawn(move || child.wait());
    true
}
