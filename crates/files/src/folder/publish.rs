//! Files that grow in a folder, and their final names.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use super::OutputFolder;
use crate::{
    disk::{create, is_real_folder},
    names::{RUN, STORE, own},
    part_file::{Mark, PartFile},
    part_folder::PartFolder,
};
use curvelax_base::error::{Error, Result};

impl OutputFolder {
    /// Begins the file `name` (with `/` between a subfolder and the file).
    pub fn file(&self, name: &str) -> Result<PartFile> {
        let (target, part) = (self.place(name), self.part(name));
        if let Some(below) = Path::new(name).parent().filter(|below| !below.as_os_str().is_empty()) {
            self.make_below(below)?;
        }
        let file = create(part.at()).map_err(part.io("cannot write"))?;
        Ok(PartFile::new(file, part, target, Mark { name: name.into(), length: 0, crc: 0 }))
    }

    /// Creates the folder `name` in it. A link to another folder does not count as one.
    fn make_below(&self, name: &Path) -> Result<()> {
        let below = self.place.join(name);
        let made = match fs::create_dir(below.at()) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists && !is_real_folder(below.at()) => Err(e),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            made => made,
        };
        made.map_err(below.io("cannot make the folder"))
    }

    /// Begins the folder `name`, which must be that of a store.
    pub fn store(&self, name: &str) -> Result<PartFolder> {
        PartFolder::begin(self.part(name), self.place(name))
    }

    /// Writes the whole file `name`, ready for [`OutputFolder::publish`].
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<PartFile> {
        let mut file = self.file(name)?;
        file.write_all(content.as_ref()).map_err(Error::io("cannot write", file.target()))?;
        file.sync()?;
        Ok(file)
    }

    /// Gives complete files their final names, `run` last, and removes files of an earlier run that this one did not
    /// write.
    ///
    /// All are on disk by now, so that little can still fail. The earlier `run.json` is removed first: at no moment
    /// does one vouch for the files of two runs.
    pub fn publish(&self, files: Vec<PartFile>, store: Option<PartFolder>, run: PartFile) -> Result<()> {
        self.check_claim()?;
        let mut written: Vec<String> = files.iter().map(|file| file.name().to_string()).collect();
        written.extend(store.iter().map(|_| STORE.to_string()));
        self.remove_own(RUN)?;
        files.into_iter().try_for_each(PartFile::finish)?;
        store.map_or(Ok(()), PartFolder::finish)?;
        for name in own().into_iter().filter(|name| !written.contains(name)) {
            self.remove_own(&name)?;
        }
        run.finish()?;
        self.check_claim()
    }

    /// Gives complete files their final names, and touches no others.
    pub fn publish_all(&self, files: Vec<PartFile>) -> Result<()> {
        self.check_claim()?;
        files.into_iter().try_for_each(PartFile::finish)?;
        self.check_claim()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        claim::LOCK,
        folder::tests::{OLD, names},
        names::{CURVES, SERIES, SUMMARY},
        owner::Owner,
    };

    #[test]
    fn a_file_has_its_name_only_when_it_is_complete() {
        let home = tempfile::tempdir().unwrap();
        let folder = OutputFolder::open(&home.path().join("a/b"), false).unwrap();
        let mut file = folder.file(CURVES).unwrap();
        file.write_all(b"half").unwrap();
        file.sync().unwrap();
        assert_eq!(names(&folder.path().join("plots")), [".curves.svg.part"]);
        file.finish().unwrap();
        assert_eq!(names(&folder.path().join("plots")), ["curves.svg"]);
        assert_eq!(fs::read(folder.path().join(CURVES)).unwrap(), b"half");
    }

    #[test]
    fn force_replaces_the_files_of_a_run_and_no_others() {
        let home = tempfile::tempdir().unwrap();
        for name in [SUMMARY, SERIES, RUN, ".notes"] {
            fs::write(home.path().join(name), OLD).unwrap();
        }
        let folder = OutputFolder::open(home.path(), true).unwrap();
        let summary = folder.write(SUMMARY, "new").unwrap();
        let run = folder.write(RUN, "new").unwrap();
        for name in [SUMMARY, SERIES, RUN] {
            assert_eq!(
                fs::read_to_string(home.path().join(name)).unwrap(),
                OLD,
                "{name} goes before the new files are ready"
            );
        }
        folder.publish(vec![summary], None, run).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [".notes", RUN, SUMMARY]);
        for (name, text) in [(SUMMARY, "new"), (RUN, "new"), (".notes", OLD)] {
            assert_eq!(fs::read_to_string(home.path().join(name)).unwrap(), text, "{name}");
        }
    }

    #[test]
    fn a_folder_of_other_files_leaves_those_of_a_run_alone() {
        let home = tempfile::tempdir().unwrap();
        for name in [SUMMARY, "plots", ".summary.csv.part", ".a.svg.part", "b.svg"] {
            fs::write(home.path().join(name), "old").unwrap();
        }
        let folder = OutputFolder::open_for(home.path(), true, Owner::Figure, vec!["a.svg".into()]).unwrap();
        let file = folder.write("a.svg", "new").unwrap();
        folder.publish_all(vec![file]).unwrap();
        drop(folder);
        assert_eq!(names(home.path()), [".summary.csv.part", "a.svg", "b.svg", "plots", SUMMARY]);
        fs::create_dir(home.path().join("c.svg")).unwrap();
        let error = OutputFolder::open_for(home.path(), true, Owner::Figure, vec!["c.svg".into()]).unwrap_err();
        assert!(error.to_string().contains("c.svg is a folder"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn no_link_is_followed() {
        let home = tempfile::tempdir().unwrap();
        let (out, mine) = (home.path().join("out"), home.path().join("mine"));
        fs::create_dir(&out).unwrap();
        fs::write(&mine, "mine").unwrap();
        let link = |name: &str, to: &Path| std::os::unix::fs::symlink(to, out.join(name)).unwrap();
        link(".curvelax.part", &mine);
        link(LOCK, &home.path().join("absent"));
        let folder = OutputFolder::open(&out, true).unwrap();
        link(".summary.csv.part", &mine);
        folder.write(SUMMARY, "new").unwrap().finish().unwrap();
        drop(folder);
        assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
        assert!(!out.join(SUMMARY).is_symlink());
        assert_eq!(names(home.path()), ["mine", "out"]);
    }

    #[test]
    fn a_failed_run_leaves_only_what_is_worth_keeping() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("out");
        let folder = OutputFolder::open(&path, false).unwrap();
        let (useless, mut useful) = (folder.file(SERIES).unwrap(), folder.file(SUMMARY).unwrap());
        useful.write_all(b"row").unwrap();
        useful.keep(true);
        drop((useless, useful, folder));
        assert_eq!(names(&path), [".summary.csv.part"]);

        let folder = OutputFolder::open(&home.path().join("empty"), false).unwrap();
        drop((folder.file(CURVES).unwrap(), folder));
        assert_eq!(names(home.path()), ["out"]);
    }
}
