use super::*;

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn a_part_that_was_left_is_never_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    fs::write(&path, "old").unwrap();
    for text in ["first", "second", "third"] {
        let mut file = GrowingFile::create(&path).unwrap();
        file.append(text.as_bytes()).unwrap();
        // The run ends here, however.
        drop(file);
    }
    let parts = [
        "log.csv",
        "log.csv.1.part",
        "log.csv.2.part",
        "log.csv.part",
    ];
    assert_eq!(names(folder.path()), parts);
    assert_eq!(fs::read(folder.path().join(parts[3])).unwrap(), b"first");
    assert_eq!(fs::read(folder.path().join(parts[1])).unwrap(), b"second");
    assert_eq!(fs::read(&path).unwrap(), b"old");
}

#[test]
fn a_bare_name_stays_bare() {
    // Nothing is in it, so that nothing stays in the current folder.
    let file = GrowingFile::create("a-log-of-this-test.csv").unwrap();
    assert_eq!(file.part(), Some(Path::new("a-log-of-this-test.csv.part")));
}

#[test]
fn a_part_in_which_nothing_is_goes_and_a_whole_file_takes_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    drop(GrowingFile::create(&path).unwrap());
    assert!(names(folder.path()).is_empty());
    GrowingFile::create(&path).unwrap().finish().unwrap();
    assert_eq!(names(folder.path()), ["log.csv"]);
    let mut file = GrowingFile::create(&path).unwrap();
    file.append(b"copied elsewhere").unwrap();
    file.discard().unwrap();
    assert_eq!(names(folder.path()), ["log.csv"]);
    assert_eq!(fs::read(&path).unwrap(), b"");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_refuses_what_is_appended() {
    let mut full = GrowingFile::create("/dev/full").unwrap();
    let error = full.append(b"1").unwrap_err();
    assert_eq!(error.source.kind(), io::ErrorKind::StorageFull);
    assert_eq!(error.kept, 0);
    assert_eq!(full.part(), None);
}

#[cfg(unix)]
#[test]
fn a_link_in_place_of_the_part_is_not_followed() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("log.csv"), folder.path().join("other"));
    fs::write(&other, "other").unwrap();
    std::os::unix::fs::symlink(&other, folder.path().join("log.csv.part")).unwrap();
    let mut file = GrowingFile::create(&path).unwrap();
    file.append(b"log").unwrap();
    file.finish().unwrap();
    assert_eq!(fs::read(&other).unwrap(), b"other");
    assert_eq!(fs::read(&path).unwrap(), b"log");
}
