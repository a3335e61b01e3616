//! Who holds a folder, and what becomes of it when it is moved, removed or replaced.

use std::fs;

use super::*;

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn a_folder_that_is_replaced_is_lost_and_its_successor_is_not_touched() {
    let home = tempfile::tempdir().unwrap();
    let [out, moved] = ["out", "moved"].map(|name| home.path().join(name));
    fs::create_dir(&out).unwrap();
    let first = Claim::take(&out).unwrap().unwrap();
    first.check().unwrap();
    assert!(Claim::take(&out).unwrap().is_none() && is_held(&out));
    fs::rename(&out, &moved).unwrap();
    let error = first.check().unwrap_err();
    assert!(
        matches!(&error, Error::Lost(_)) && error.to_string().contains("was moved, removed or replaced"),
        "{error}"
    );
    fs::create_dir(&out).unwrap();
    let second = Claim::take(&out).unwrap().unwrap();
    assert!(matches!(first.check(), Err(Error::Lost(_))) && !first.is_there().unwrap());
    second.check().unwrap();
    drop(first);
    assert_eq!((names(&out), names(&moved)), (vec![LOCK.into()], vec![]));
    fs::remove_dir_all(&out).unwrap();
    assert!(matches!(second.check(), Err(Error::Lost(_))));
}

#[test]
fn a_folder_is_free_at_once_although_a_program_that_is_being_started_has_copies_of_its_locks() {
    let home = tempfile::tempdir().unwrap();
    let claim = Claim::take(home.path()).unwrap().unwrap();
    let copies = [claim.folder.as_ref().unwrap(), &claim.lock].map(|held| held.try_clone().unwrap());
    drop(claim);
    assert!(!is_held(home.path()) && Claim::take(home.path()).unwrap().is_some());
    drop(copies);
}

#[test]
fn without_its_file_a_folder_is_held_by_its_own_lock_alone() {
    let home = tempfile::tempdir().unwrap();
    let mut claim = Claim::take(home.path()).unwrap().unwrap();
    fs::remove_file(home.path().join(LOCK)).unwrap();
    claim.check().unwrap();
    assert!(Claim::take(home.path()).unwrap().is_none() && is_held(home.path()));
    // As on file systems that lock files only.
    claim.whole = false;
    fs::write(home.path().join(LOCK), "").unwrap();
    let error = claim.check().unwrap_err().to_string();
    assert!(error.contains("its lock .curvelax.lock was removed or replaced"), "{error}");
    drop(claim);
    assert_eq!(names(home.path()), [LOCK], "it is another's");
}
