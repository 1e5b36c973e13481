//! Opening a browser. The address holds the page's key, and every user of the machine may read the
//! words of a command: so the browser is given a file that only this user may read, which sends it
//! on to the address.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use tempfile::{Builder, TempDir, TempPath};

/// What a user's runtime folder is called by: in memory, and nobody else's.
const RUNTIME: &str = "XDG_RUNTIME_DIR";

/// Browsers that the user prefers: commands, one after the other between colons.
const PREFERRED: &str = "BROWSER";

/// A file that sends a browser on; gone when dropped.
pub(super) struct Signpost {
    // The file goes before its folder.
    file: TempPath,
    _folder: TempDir,
}

/// Asks the system to show an address; the signpost to it has to stay until it is shown.
///
/// # Errors
/// If the signpost cannot be put up, or there is no browser.
pub(super) fn open(url: &str) -> io::Result<Signpost> {
    let signpost = Signpost::write(url)?;
    match commands(&signpost.file).into_iter().any(start) {
        true => Ok(signpost),
        false => Err(io::Error::new(io::ErrorKind::NotFound, "none was found")),
    }
}

impl Signpost {
    fn write(url: &str) -> io::Result<Self> {
        let folder = folder()?;
        // Made for this user alone, whatever the umask says.
        let mut file = Builder::new()
            .prefix("play-")
            .suffix(".html")
            .tempfile_in(folder.path())?;
        file.write_all(page(url).as_bytes())?;
        Ok(Self {
            file: file.into_temp_path(),
            _folder: folder,
        })
    }
}

/// A new folder of this user's own.
fn folder() -> io::Result<TempDir> {
    let mut builder = Builder::new();
    builder.prefix("pegfit-play-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o700));
    }
    let runtime = std::env::var_os(RUNTIME).filter(|folder| Path::new(folder).is_absolute());
    match runtime.map(|folder| builder.tempdir_in(folder)) {
        Some(Ok(folder)) => Ok(folder),
        _ => builder.tempdir(),
    }
}

/// An address has no character that HTML takes for its own.
fn page(url: &str) -> String {
    format!(
        "<!doctype html>\n<meta charset=\"utf-8\">\n\
         <meta name=\"referrer\" content=\"no-referrer\">\n\
         <meta http-equiv=\"refresh\" content=\"0; url={url}\">\n\
         <title>pegfit play</title>\n<p><a href=\"{url}\">pegfit play</a></p>\n"
    )
}

/// What may show a file, the most wanted first.
fn commands(file: &Path) -> Vec<Command> {
    let preferred = std::env::var(PREFERRED).unwrap_or_default();
    let preferred = preferred.split(':').filter_map(|text| words(text, file));
    let system = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let system = vec![system.into(), file.into()];
    let all = preferred.chain([system]).map(|words| {
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]);
        command
    });
    all.collect()
}

/// The words of one preferred browser: the file in place of `%s`, else last. `None` if it has none.
fn words(text: &str, file: &Path) -> Option<Vec<OsString>> {
    let mut words: Vec<OsString> = text.split_whitespace().map(OsString::from).collect();
    words.first()?;
    match words.iter_mut().find(|word| *word == "%s") {
        Some(place) => *place = file.into(),
        None => words.push(file.into()),
    }
    Some(words)
}

/// True if it could be started.
fn start(mut command: Command) -> bool {
    let quiet = command
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preferred_browser_gets_the_file_where_it_says() {
        let file = Path::new("/run/user/1/play.html");
        let words = |text| {
            let words = words(text, file)?;
            Some(words.join(" ".as_ref()).into_string().unwrap())
        };
        assert_eq!(words("firefox").unwrap(), "firefox /run/user/1/play.html");
        let there = words(" lynx -x  %s -y ").unwrap();
        assert_eq!(there, "lynx -x /run/user/1/play.html -y");
        assert_eq!(words("  "), None);
    }
}
