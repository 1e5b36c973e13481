use std::io::{Error, ErrorKind};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use super::*;

fn names(folder: &Path) -> Vec<OsString> {
    let entries = fs::read_dir(folder).unwrap();
    entries.map(|e| e.unwrap().file_name()).collect()
}

#[test]
fn a_failed_fill_leaves_the_old_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    write(&path, b"old").unwrap();
    let result = write_with(&path, |out| {
        out.write_all(b"half")?;
        Err(Error::from(ErrorKind::InvalidData))
    });
    assert_eq!(result.unwrap_err().kind(), ErrorKind::InvalidData);
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["a.txt"]);
    write_with(&path, |out| out.write_all(b"new")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"new");
    assert_eq!(names(folder.path()), ["a.txt"]);
}

#[test]
fn a_file_is_not_there_before_it_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"1,2\n").unwrap();
    file.flush().unwrap();
    assert!(!path.exists());
    file.commit().unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"1,2\n");
    drop(AtomicFile::create(&path).unwrap());
    assert_eq!(names(folder.path()), ["log.csv"]);
}

#[test]
fn the_first_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let [mut first, mut second] = [(); 2].map(|()| AtomicFile::create(&path).unwrap());
    first.write_all(b"first").unwrap();
    second.write_all(b"second").unwrap();
    assert!(first.commit_new().unwrap());
    assert!(!second.commit_new().unwrap());
    assert_eq!(fs::read(&path).unwrap(), b"first");
    assert_eq!(names(folder.path()), ["a"]);
}

#[test]
fn a_file_may_be_made_in_another_folder() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    fs::create_dir(&inner).unwrap();
    let mut file = AtomicFile::create_in(folder.path(), inner.join("a")).unwrap();
    file.write_all(b"a").unwrap();
    assert!(names(&inner).is_empty());
    file.commit().unwrap();
    assert_eq!(names(&inner), ["a"]);
    assert_eq!(names(folder.path()), ["inner"]);
}

#[test]
fn of_two_writers_at_once_one_wins_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shared");
    let content = |letter: u8| vec![letter; 100_000];
    write(&path, &content(b'a')).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let writers = [b'a', b'b'].map(|letter| {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..20 {
                    write(path, &content(letter)).unwrap();
                }
            })
        });
        let reader = scope.spawn(|| {
            while !done.load(Relaxed) {
                let found = fs::read(&path).unwrap();
                assert_eq!(found.len(), 100_000);
                assert!(found.iter().all(|&b| b == found[0]));
            }
        });
        writers.into_iter().for_each(|w| w.join().unwrap());
        done.store(true, Relaxed);
        reader.join().unwrap();
    });
    assert_eq!(names(folder.path()), ["shared"]);
}

#[test]
fn a_missing_folder_is_refused_by_the_path_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("missing").join("a.txt");
    let error = write(&path, b"a").unwrap_err();
    assert_eq!(error.path, path);
    assert_eq!(error.source.kind(), ErrorKind::NotFound);
    let error = AtomicFolder::create(&path).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("cannot write {}", path.display())
    );
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_bare_name_lies_in_the_current_folder() {
    assert_eq!(folder_of(Path::new("a.txt")), Path::new("."));
    assert_eq!(folder_of(Path::new("b/a.txt")), Path::new("b"));
    assert_eq!(prefix(Path::new("b/a.txt")), ".a.txt.");
}

#[test]
fn a_folder_appears_whole_and_the_first_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.zarr");
    let [first, second] = ["first", "second"].map(|content| {
        let made = AtomicFolder::create(&path).unwrap();
        fs::create_dir(made.temporary().join("energy")).unwrap();
        fs::write(made.temporary().join("energy/zarr.json"), content).unwrap();
        made
    });
    assert!(!path.exists());
    assert!(first.commit_new().unwrap());
    assert!(!second.commit_new().unwrap());
    assert_eq!(fs::read(path.join("energy/zarr.json")).unwrap(), b"first");
    assert_eq!(names(folder.path()), ["t.zarr"]);
    let file = folder.path().join("file");
    write(&file, b"a").unwrap();
    let error = AtomicFolder::create(&file).unwrap().commit_new();
    assert_eq!(error.unwrap_err().path, file);
    assert_eq!(fs::read(&file).unwrap(), b"a");
}

#[cfg(unix)]
mod modes {
    use std::os::unix::fs::PermissionsExt;
    use std::process::Command;

    use super::*;

    const FOLDER: &str = "ATOMIC_TEST_FOLDER";

    /// Run by the next test in processes of their own, since a umask belongs to the whole process.
    #[test]
    #[ignore = "run by what_is_written_has_an_ordinary_mode"]
    fn write_one_of_each() {
        let Some(folder) = std::env::var_os(FOLDER) else {
            return;
        };
        std::env::set_current_dir(&folder).unwrap();
        write(Path::new("file"), b"content").unwrap();
        let made = AtomicFolder::create("folder").unwrap();
        assert!(made.commit_new().unwrap());
    }

    #[test]
    fn what_is_written_has_an_ordinary_mode() {
        for (umask, file, inner) in [
            ("022", 0o644, 0o755),
            ("077", 0o600, 0o700),
            ("002", 0o664, 0o775),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let status = Command::new("sh")
                .args(["-c", &format!("umask {umask} && exec \"$0\" \"$@\"")])
                .arg(std::env::current_exe().unwrap())
                .args(["modes::write_one_of_each", "--ignored", "--test-threads=1"])
                .env(FOLDER, folder.path())
                .stdout(std::process::Stdio::null())
                .status()
                .unwrap();
            assert!(status.success());
            let mode = |name| {
                let found = fs::metadata(folder.path().join(name)).unwrap();
                found.permissions().mode() & 0o777
            };
            assert_eq!((mode("file"), mode("folder")), (file, inner), "{umask}");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_what_it_leads_to_is_replaced() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    fs::create_dir(&inner).unwrap();
    let (link, second) = (folder.path().join("link"), folder.path().join("second"));
    symlink("inner/file", &link).unwrap();
    symlink("link", &second).unwrap();
    // Once where nothing is yet, once over a file.
    for content in [b"1", b"2"] {
        write(&second, content).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::symlink_metadata(&second).unwrap().is_symlink());
        assert_eq!(fs::read(inner.join("file")).unwrap(), content);
    }
    assert_eq!(names(&inner), ["file"]);
    let round = folder.path().join("round");
    symlink("round", &round).unwrap();
    write(&round, b"3").unwrap();
    assert_eq!(fs::read(&round).unwrap(), b"3");
}

#[cfg(unix)]
#[test]
fn a_device_or_a_pipe_stays_what_it_is() {
    use std::io::Read;
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::FileTypeExt;

    let null = Path::new("/dev/null");
    write(null, b"gone").unwrap();
    let (mut reader, writer) = io::pipe().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    let descriptor = format!("/dev/fd/{}", writer.as_raw_fd());
    std::os::unix::fs::symlink(descriptor, &path).unwrap();
    write(&path, b"through").unwrap();
    let mut file = AtomicFile::create_in(folder.path(), &path).unwrap();
    file.write_all(b" and again").unwrap();
    assert!(!file.commit_new().unwrap());
    drop(writer);
    let mut content = String::new();
    reader.read_to_string(&mut content).unwrap();
    assert_eq!(content, "through and again");
    assert_eq!(names(folder.path()), ["out"]);
    assert!(
        fs::symlink_metadata(null)
            .unwrap()
            .file_type()
            .is_char_device()
    );
}
