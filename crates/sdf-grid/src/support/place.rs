//! The target of content that is written to a path: a file that is replaced, or a stream.
//!
//! A symbolic link is followed, but for one that another user has put into a folder that everybody
//! may write to: it would have content written where that user wants it. Linux refuses such links,
//! and pipes, by itself where `fs.protected_symlinks` and `fs.protected_fifos` are on.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// As many links in a row as Linux follows.
const MOST_LINKS: usize = 40;

/// The target at a path.
#[derive(Debug)]
pub(crate) enum Place {
    /// A file that may be replaced, or nothing yet; no link any more.
    File(PathBuf),
    /// A device, a pipe or an open descriptor: what is written is gone there.
    Through(File),
}

impl Place {
    /// Finds the target of content for `path`.
    ///
    /// A descriptor that this process holds, such as `/dev/stdout`, is shared and not opened again:
    /// content then follows what was written there before.
    ///
    /// # Errors
    /// If a link or a pipe on the way was put there by another user, or what takes content as it
    /// comes cannot be opened.
    pub(crate) fn find(path: &Path) -> io::Result<Self> {
        let at = led_to(path)?;
        match descriptor(&at) {
            Some(Descriptor::Own(number)) => return duplicate(number).map(Self::Through),
            Some(Descriptor::Other) => {
                let file = File::options().append(true).open(&at)?;
                return Ok(Self::Through(file));
            }
            None => {}
        }
        match fs::metadata(&at) {
            Ok(found) if !found.is_file() && !found.is_dir() => {
                require_own(&at, &found, "a pipe or a device")?;
                Ok(Self::Through(File::options().write(true).open(&at)?))
            }
            _ => Ok(Self::File(at)),
        }
    }
}

/// Refuses a path on which a link, a pipe or a device is that another user has put into a folder
/// that everybody may write to.
///
/// # Errors
/// Says what was found, and where.
pub fn require_unplanted(path: &Path) -> io::Result<()> {
    let at = led_to(path)?;
    match fs::metadata(&at) {
        Ok(found) if !found.is_file() && !found.is_dir() && descriptor(&at).is_none() => {
            require_own(&at, &found, "a pipe or a device")
        }
        _ => Ok(()),
    }
}

/// Where a chain of symbolic links leads to, whether something is there or not; of descriptors that
/// are open, up to where the system lists them. `path` itself if the chain does not end.
fn led_to(path: &Path) -> io::Result<PathBuf> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        if descriptor(&at).is_some() {
            return Ok(at);
        }
        for part in at.ancestors() {
            match fs::symlink_metadata(part) {
                Ok(found) if found.is_symlink() => require_own(part, &found, "a link")?,
                _ => {}
            }
        }
        match fs::read_link(&at) {
            Ok(target) => at = folder_of(&at).join(target),
            Err(_) => return Ok(at),
        }
    }
    Ok(path.to_owned())
}

/// An open descriptor as the system lists it; what it leads to need not have a name.
enum Descriptor {
    /// Of this process.
    Own(u32),
    /// Of another one.
    Other,
}

fn descriptor(path: &Path) -> Option<Descriptor> {
    let number: u32 = path.file_name()?.to_str()?.parse().ok()?;
    // Through links such as /dev/fd and /proc/self.
    let folder = fs::canonicalize(folder_of(path)).ok()?;
    if !folder.ends_with("fd") {
        return None;
    }
    let own = fs::canonicalize("/proc/self").is_ok_and(|own| folder.starts_with(own));
    match own || folder == Path::new("/dev/fd") {
        true => Some(Descriptor::Own(number)),
        false => folder.starts_with("/proc").then_some(Descriptor::Other),
    }
}

/// The folder that `path` lies in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

#[cfg(unix)]
fn require_own(path: &Path, found: &fs::Metadata, what: &str) -> io::Result<()> {
    use std::os::unix::fs::MetadataExt;

    /// Everybody may put files there.
    const SHARED: u32 = 0o002;
    let folder = fs::metadata(folder_of(path))?;
    let (owner, own) = (found.uid(), rustix::process::geteuid().as_raw());
    if folder.mode() & SHARED == 0 || owner == own || owner == folder.uid() {
        return Ok(());
    }
    Err(io::Error::new(
        io::ErrorKind::PermissionDenied,
        format!(
            "{} is {what} that another user ({owner}) has put into a folder that everybody may \
             write to: nothing is written through it",
            path.display()
        ),
    ))
}

#[cfg(not(unix))]
fn require_own(_: &Path, _: &fs::Metadata, _: &str) -> io::Result<()> {
    Ok(())
}

/// The same open file, with the same place in it.
#[cfg(unix)]
fn duplicate(number: u32) -> io::Result<File> {
    use std::io::Write;
    use std::os::fd::{AsFd, BorrowedFd, RawFd};

    let number = RawFd::try_from(number).map_err(io::Error::other)?;
    let descriptor = match number {
        // What this process has printed comes first.
        1 => {
            let mut out = io::stdout();
            out.flush()?;
            return Ok(out.as_fd().try_clone_to_owned()?.into());
        }
        // SAFETY: borrowed for one call, which answers that it is not open if it is not.
        _ => unsafe { BorrowedFd::borrow_raw(number) },
    };
    Ok(rustix::io::fcntl_dupfd_cloexec(descriptor, 3)?.into())
}

#[cfg(not(unix))]
fn duplicate(_: u32) -> io::Result<File> {
    Err(io::ErrorKind::Unsupported.into())
}
