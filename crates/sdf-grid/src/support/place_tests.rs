//! What stands in the way of files that are written whole, and of those that grow.

use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{PermissionsExt, lchown, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use super::GrowingFile;
use crate::support::atomic;
use crate::support::place::require_unplanted;

/// Not root, and nobody whose process this is.
const STRANGER: u32 = 54_321;

/// A folder that everybody may write to; `mode` has the sticky bit or has not.
fn shared(mode: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(mode)).unwrap();
    folder
}

/// Gives `path` to somebody else; false where one may not.
fn give_away(path: &Path) -> bool {
    let given = lchown(path, Some(STRANGER), None).is_ok();
    if !given {
        println!("skipped: no right to give files away");
    }
    given
}

#[test]
fn nothing_is_written_through_what_another_user_planted() {
    for mode in [0o1777, 0o777] {
        let (folder, mine) = (shared(mode), tempfile::tempdir().unwrap());
        let precious = mine.path().join("precious");
        let link = folder.path().join("out.csv");
        symlink(&precious, &link).unwrap();
        // One's own link is followed, whether something is there or not.
        atomic::write(&link, b"1").unwrap();
        atomic::write(&link, b"2").unwrap();
        assert_eq!(fs::read(&precious).unwrap(), b"2");
        require_unplanted(&link).unwrap();
        if !give_away(&link) {
            return;
        }
        // A second link of one's own that leads to the planted one, and a planted folder.
        let (second, room) = (mine.path().join("second"), folder.path().join("room"));
        symlink(&link, &second).unwrap();
        symlink(mine.path(), &room).unwrap();
        assert!(give_away(&room));
        for path in [&link, &second, &room.join("new")] {
            let error = atomic::write(path, b"3").unwrap_err();
            assert_eq!(error.source.kind(), io::ErrorKind::PermissionDenied);
            let said = error.source.to_string();
            assert!(said.contains("another user (54321)"), "{said}");
            assert!(GrowingFile::create(path).is_err());
            assert!(require_unplanted(path).is_err());
        }
        assert_eq!(fs::read(&precious).unwrap(), b"2");
        assert!(!mine.path().join("new").exists());
    }
}

#[test]
fn a_planted_pipe_gets_nothing_and_a_planted_file_is_replaced() {
    let folder = shared(0o1777);
    let (pipe, file) = (folder.path().join("pipe"), folder.path().join("file"));
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    fs::write(&file, b"theirs").unwrap();
    if !(give_away(&pipe) && give_away(&file)) {
        return;
    }
    assert!(atomic::write(&pipe, b"secret").is_err());
    atomic::write(&file, b"mine").unwrap();
    assert_ne!(owner(&file), STRANGER);
}

fn owner(path: &Path) -> u32 {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).unwrap().uid()
}

#[test]
fn a_link_in_a_folder_of_its_owner_or_of_nobody_else_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let (link, to) = (folder.path().join("link"), folder.path().join("to"));
    symlink("to", &link).unwrap();
    if !give_away(&link) {
        return;
    }
    // The folder is not shared.
    atomic::write(&link, b"1").unwrap();
    assert_eq!(fs::read(&to).unwrap(), b"1");
    // It is shared, and the folder's owner made the link.
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o1777)).unwrap();
    assert!(give_away(folder.path()));
    atomic::write(&link, b"2").unwrap();
    assert_eq!(fs::read(&to).unwrap(), b"2");
}

/// A file open for writing, with something in it already.
fn opened(folder: &Path) -> File {
    let mut file = File::options()
        .read(true)
        .write(true)
        .create_new(true)
        .open(folder.join("shared.txt"))
        .unwrap();
    file.write_all(b"first a longer line\n").unwrap();
    file
}

fn read_all(file: &mut File) -> String {
    let mut text = String::new();
    file.rewind().unwrap();
    file.read_to_string(&mut text).unwrap();
    text
}

#[test]
fn content_for_an_open_descriptor_follows_what_is_there_and_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = opened(folder.path());
    let number = file.as_raw_fd();
    let link = folder.path().join("link");
    symlink(format!("/proc/self/fd/{number}"), &link).unwrap();
    let names = [
        PathBuf::from(format!("/proc/self/fd/{number}")),
        PathBuf::from(format!("/proc/{}/fd/{number}", std::process::id())),
        PathBuf::from(format!("/dev/fd/{number}")),
        PathBuf::from(format!("/dev/../dev//fd/{number}")),
        link,
    ];
    let mut expected = "first a longer line\n".to_owned();
    for (at, name) in names.iter().enumerate() {
        atomic::write(name, format!("{at}\n").as_bytes()).unwrap();
        let mut grown = GrowingFile::create(name).unwrap();
        assert_eq!(grown.part(), None);
        grown.append(b"grown\n").unwrap();
        grown.finish().unwrap();
        file.write_all(b"said\n").unwrap();
        expected += &format!("{at}\ngrown\nsaid\n");
    }
    assert_eq!(read_all(&mut file), expected);
    let entries = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(entries, 2, "the file and the link, nothing else");
}

#[test]
fn a_descriptor_of_another_process_gets_content_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = opened(folder.path());
    let mut other = Command::new("sleep")
        .arg("600")
        .stdout(file.try_clone().unwrap())
        .spawn()
        .unwrap();
    let name = PathBuf::from(format!("/proc/{}/fd/1", other.id()));
    let written = atomic::write(&name, b"last\n");
    other.kill().unwrap();
    other.wait().unwrap();
    written.unwrap();
    assert_eq!(read_all(&mut file), "first a longer line\nlast\n");
}

#[test]
fn a_descriptor_that_is_closed_or_cannot_be_written_is_refused() {
    let closed = Path::new("/proc/self/fd/999999");
    assert!(atomic::write(closed, b"1").is_err());
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a"), "content").unwrap();
    let readable = File::open(folder.path().join("a")).unwrap();
    let name = PathBuf::from(format!("/dev/fd/{}", readable.as_raw_fd()));
    assert!(atomic::write(&name, b"1").is_err());
    assert_eq!(fs::read(folder.path().join("a")).unwrap(), b"content");
}

#[test]
fn a_named_pipe_gives_its_reader_all_and_stays() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    let reader = {
        let pipe = pipe.clone();
        std::thread::spawn(move || fs::read(pipe).unwrap())
    };
    atomic::write(&pipe, &[7; 200_000]).unwrap();
    assert_eq!(reader.join().unwrap(), [7; 200_000]);
    let entries: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(entries.len(), 1);
}
