//! A folder that is moved while it is open.

use std::fs;

use super::*;

#[test]
fn a_folder_that_was_opened_is_reached_wherever_it_is() {
    let home = tempfile::tempdir().unwrap();
    let [path, moved] = ["out", "moved"].map(|name| home.path().join(name));
    fs::create_dir(&path).unwrap();
    let place = Place::opened(&path, Some(&Arc::new(File::open(&path).unwrap()))).join("file");
    fs::rename(&path, &moved).unwrap();
    fs::create_dir(&path).unwrap();
    fs::write(place.at(), "mine").unwrap();
    assert_eq!(fs::read(moved.join("file")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
    assert_eq!(place.shown(), path.join("file"));
    fs::remove_dir_all(&moved).unwrap();
    assert_eq!(fs::write(place.at(), "mine").unwrap_err().kind(), io::ErrorKind::NotFound);
}
