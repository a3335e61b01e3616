//! The only way in which files are opened for reading: regular files only, up to a size that no genuine one exceeds.
//!
//! A pipe may never end and a device never does, so neither is opened: a wrong path gives an error at once.

use std::{
    fs::{self, File, Metadata, OpenOptions},
    io::{self, Error, ErrorKind, Read},
    path::Path,
};

use crate::text::{bytes as in_words, count};

/// Maximum bytes of a spec: half a million members listed by number.
pub const MAX_SPEC: u64 = 1 << 20;
/// Maximum bytes of an outline: a million points with all their digits.
pub const MAX_OUTLINE: u64 = 1 << 26;
/// Maximum bytes of a `run.json`: the longest spec, line by line.
pub const MAX_RUN: u64 = 1 << 22;
/// Maximum bytes of the first members: ten times the size of those that a study keeps.
pub const MAX_PORTRAITS: u64 = 1 << 23;
/// Maximum bytes of a line of a table: a thousand numbers.
pub const MAX_LINE: usize = 1 << 16;

/// Maximum bytes of a checkpoint or a `shard.state`: one that is written is in memory along with the members.
pub const MAX_STATE: u64 = 1 << 34;

/// Opens the file at `path` for reading.
///
/// # Errors
/// Those of [`File::open`], and one if it is not a regular file.
pub fn open(path: &Path) -> io::Result<File> {
    open_as(path, File::options().read(true))
}

/// Opens the file at `path` with `options`.
///
/// # Errors
/// Those of [`open`].
pub fn open_as(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    // Checked before opening, which some devices take as a command.
    match fs::metadata(path) {
        Err(e) if e.kind() == ErrorKind::NotFound => {}
        there => is_file(&there?)?,
    }
    let file = at_once(options).open(path)?;
    // It may have been replaced in between.
    is_file(&file.metadata()?)?;
    Ok(file)
}

fn is_file(of: &Metadata) -> io::Result<()> {
    match () {
        _ if of.is_dir() => Err(ErrorKind::IsADirectory.into()),
        _ if !of.is_file() => Err(Error::other("a pipe or a device; save what it holds in a file")),
        _ => Ok(()),
    }
}

/// Avoids waiting: opening a pipe waits for its writer, and some system files, such as `/proc/kmsg`, are read like one.
#[cfg(unix)]
fn at_once(options: &mut OpenOptions) -> &mut OpenOptions {
    use std::os::unix::fs::OpenOptionsExt;
    const O_NONBLOCK: i32 = if cfg!(any(target_os = "linux", target_os = "android")) { 0o4000 } else { 4 };
    options.custom_flags(O_NONBLOCK)
}

#[cfg(not(unix))]
fn at_once(options: &mut OpenOptions) -> &mut OpenOptions {
    options
}

/// Returns the content of the file at `path`, if it has at most `most` bytes.
///
/// # Errors
/// Those of [`open`], and one for a longer file.
pub fn bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let limit = in_words(most);
    let too_long = |size: &str| Error::new(ErrorKind::FileTooLarge, format!("{size}; at most {limit} are read"));
    let size = file.metadata()?.len();
    if size > most {
        // A little more than 64 MB would be 64 MB, too.
        let rounded = in_words(size);
        return Err(too_long(&if rounded == limit {
            format!("{} too many", count(size - most, "byte"))
        } else {
            rounded
        }));
    }
    // System files do not know their size beforehand.
    let mut bytes = Vec::new();
    let read = file.take(most + 1).read_to_end(&mut bytes).map_err(|e| match e.kind() {
        ErrorKind::WouldBlock => {
            Error::new(e.kind(), "it waits for more, as a pipe does; save what it holds in a file")
        }
        _ => e,
    });
    match read? as u64 > most {
        true => Err(too_long(&format!("more than {limit}"))),
        false => Ok(bytes),
    }
}

/// Returns the content as text.
///
/// # Errors
/// Those of [`bytes`], and one if it is not UTF-8.
pub fn text(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(bytes(path, most)?).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        Error::new(ErrorKind::InvalidData, format!("byte {at} is not UTF-8; save it as UTF-8"))
    })
}

/// A reader that fails if a line is longer than [`MAX_LINE`] bytes, or leaves a quote open, so that no reader of CSV
/// holds more than that.
pub struct Lines<R> {
    inner: R,
    /// Bytes since the last line end.
    since: usize,
    /// Whether these leave a quote open.
    quoted: bool,
}

impl<R: Read> Lines<R> {
    /// Reads from `inner`.
    pub fn new(inner: R) -> Lines<R> {
        Lines { inner, since: 0, quoted: false }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        for byte in &buffer[..count] {
            let ends = *byte == b'\n';
            self.quoted ^= *byte == b'"';
            self.since = if ends { 0 } else { self.since + 1 };
            let problem = match () {
                _ if self.since > MAX_LINE => format!("a line of more than {MAX_LINE} bytes"),
                _ if ends && self.quoted => "a quote that is not closed on its line".into(),
                _ => continue,
            };
            return Err(Error::new(ErrorKind::InvalidData, problem));
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_size_and_no_further() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("file");
        fs::write(&path, "1234").unwrap();
        assert_eq!(bytes(&path, 4).unwrap(), b"1234");
        assert_eq!(bytes(&path, 3).unwrap_err().to_string(), "4 bytes; at most 3 bytes are read");
        assert_eq!(bytes(home.path(), 4).unwrap_err().kind(), ErrorKind::IsADirectory);
        fs::write(&path, b"ab\xff").unwrap();
        assert_eq!(text(&path, 4).unwrap_err().to_string(), "byte 2 is not UTF-8; save it as UTF-8");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_file_without_a_size_and_a_device_have_no_end_that_is_waited_for() {
        let error = bytes(Path::new("/proc/self/status"), 10).unwrap_err().to_string();
        assert_eq!(error, "more than 10 bytes; at most 10 bytes are read");
        assert!(bytes(Path::new("/dev/zero"), 10).unwrap_err().to_string().starts_with("a pipe or a device; "));
    }

    #[test]
    fn a_line_is_read_up_to_its_longest_wherever_reads_end() {
        let line = |length: usize| [vec![b'x'; length], vec![b'\n']].concat();
        let read = |text: &[u8], step: usize| {
            let mut lines = Lines::new(text);
            let mut part = vec![0; step];
            loop {
                match lines.read(&mut part) {
                    Ok(0) => return Ok(()),
                    Ok(_) => {}
                    Err(e) => return Err(e.to_string()),
                }
            }
        };
        for step in [1, 7, 4096, MAX_LINE + 1, 10 * MAX_LINE] {
            let longest = line(MAX_LINE);
            assert_eq!(read(&[&longest[..], &longest, b"\n\n", &longest].concat(), step), Ok(()), "{step}");
            let longer = [&longest[..], &line(MAX_LINE + 1)].concat();
            assert!(read(&longer, step).is_err(), "{step}");
            assert!(read(&vec![b'x'; 30 * MAX_LINE], step).is_err(), "{step}");
        }
    }
}
