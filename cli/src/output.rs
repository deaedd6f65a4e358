//! Where a command's results go: for people to stdout, for programs to a file or, instead of the other, to stdout.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use serde::Serialize;
use tempfile::NamedTempFile;

use crate::failure::Failure;
use crate::file_error::{FileError, Problem};

/// Files that are there are replaced.
static FORCE: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Where a program that calls the commands takes the machine-readable result that is for stdout.
    static CAPTURED: RefCell<Option<Vec<u8>>> = const { RefCell::new(None) };
}

/// Runs `command` in this thread; gives what it wrote as its machine-readable result to stdout, and how it ended.
pub fn captured<T>(command: impl FnOnce() -> T) -> (Vec<u8>, T) {
    CAPTURED.set(Some(Vec::new()));
    let ended = command();
    (CAPTURED.take().unwrap_or_default(), ended)
}

/// The option that every command has.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ForceOption {
    /// Replace files that are there; without it nothing is overwritten
    #[arg(long, global = true)]
    force: bool,
}

impl ForceOption {
    /// From now on what is asked for holds.
    pub fn apply(self) {
        FORCE.store(self.force, Ordering::Relaxed);
    }
}

/// Files that are there are to be replaced.
pub fn is_forced() -> bool {
    FORCE.load(Ordering::Relaxed)
}

/// The option that every command with a result has.
#[derive(Args, Clone, Debug, Default)]
pub struct JsonOption {
    /// Write the machine-readable result to FILE; "-" is stdout, which then carries nothing else
    #[arg(long = "json", value_name = "FILE", global = true)]
    file: Option<PathBuf>,
}

impl JsonOption {
    /// Where text for people goes: nowhere, when stdout carries the machine-readable result or nobody reads it. Files are written all the same.
    pub fn human(&self) -> Box<dyn Write> {
        if self.is_stdout() { Box::new(io::sink()) } else { Box::new(ReadOrNot(people())) }
    }

    /// The machine-readable result was asked for.
    pub fn is_asked_for(&self) -> bool {
        self.file.is_some()
    }

    /// Writes the machine-readable result, if it was asked for. Every digit of every number is kept.
    pub fn write(&self, value: &impl Serialize) -> Result<(), Failure> {
        let Some(path) = &self.file else { return Ok(()) };
        if self.is_stdout() {
            return Ok(CAPTURED.with_borrow_mut(|captured| match captured {
                Some(captured) => write_json(captured, value),
                None => write_json(&mut io::stdout().lock(), value),
            })?);
        }
        let write = || {
            let mut file = create(path)?;
            write_json(&mut file, value)?;
            file.finish()
        };
        write().map_err(|error| FileError::whole(path, error).into())
    }

    /// The file that the result goes to.
    pub fn path(&self) -> Option<&Path> {
        self.file.as_deref().filter(|_| !self.is_stdout())
    }

    fn is_stdout(&self) -> bool {
        self.file.as_deref() == Some(Path::new("-"))
    }
}

/// A file that appears whole or not at all: until [`Self::finish`] it has another name, and one that is there before stays as it is.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    /// A file that is there gives way.
    replaces: bool,
    to: BufWriter<To>,
}

#[derive(Debug)]
enum To {
    /// A terminal, a pipe.
    Device(File),
    Beside(NamedTempFile),
}

impl Write for To {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Device(device) => device.write(bytes),
            Self::Beside(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Device(device) => device.flush(),
            Self::Beside(file) => file.flush(),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.to.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

impl Output {
    /// Brings everything to the disk, and the file to its name.
    pub fn finish(self) -> io::Result<()> {
        let To::Beside(file) = self.to.into_inner().map_err(|error| error.into_error())? else { return Ok(()) };
        file.as_file().sync_all()?;
        let put = if self.replaces { file.persist(&self.path) } else { file.persist_noclobber(&self.path) };
        put.map(|_| ()).map_err(|error| refusal(error.error))
    }
}

fn refusal(error: io::Error) -> io::Error {
    match error.kind() {
        io::ErrorKind::AlreadyExists => {
            io::Error::new(error.kind(), "the file exists, and nothing is overwritten without --force")
        }
        io::ErrorKind::NotFound => io::Error::new(error.kind(), "there is no such folder to put it into"),
        _ => error,
    }
}

/// Creates a file. One that is there is replaced only if that was asked for.
pub fn create(path: &Path) -> io::Result<Output> {
    open(path, is_forced())
}

/// Creates the successor of a file, which it replaces as a whole.
pub fn replace(path: &Path) -> io::Result<Output> {
    open(path, true)
}

fn open(path: &Path, replaces: bool) -> io::Result<Output> {
    let to = match std::fs::metadata(path) {
        Ok(kind) if kind.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(kind) if !kind.is_file() => To::Device(File::create(path)?),
        Ok(_) if !replaces => return Err(refusal(io::ErrorKind::AlreadyExists.into())),
        _ => To::Beside(beside(path)?),
    };
    Ok(Output { path: path.to_owned(), replaces, to: BufWriter::new(to) })
}

/// A file without a lasting name in the folder of `path`.
fn beside(path: &Path) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".north-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|error| match folder.is_dir() {
        true => takes_no_file(folder, &error),
        false => refusal(error.kind().into()),
    })
}

/// The system's reason why a folder that is there takes no file; without the hidden name of the file, which nobody has heard of and which
/// `tempfile` sets behind it.
fn takes_no_file(folder: &Path, error: &io::Error) -> io::Error {
    let said = error.to_string();
    let of_system = said.split_once(" at path ").map_or(said.as_str(), |(reason, _)| reason);
    io::Error::new(error.kind(), format!("no file can be made in the folder {}: {of_system}", folder.display()))
}

/// Whether a folder can be made, or one that is there can be written to.
///
/// Errors: the system's, of the nearest folder that is there.
pub fn check_folder(folder: &Path) -> io::Result<()> {
    let named = folder.ancestors().filter(|folder| !folder.as_os_str().is_empty());
    let nearest = named.into_iter().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    match nearest.is_dir() {
        true => beside(&nearest.join("run")).map(|_| ()),
        false => Err(io::ErrorKind::NotADirectory.into()),
    }
}

/// Writes a file, as [`create`] makes it.
pub fn write(path: &Path, text: impl AsRef<[u8]>) -> io::Result<()> {
    let mut file = create(path)?;
    file.write_all(text.as_ref())?;
    file.finish()
}

/// Whether those files can be written that were asked for: before the work whose results they take.
///
/// Errors: two of them are the same; the first that is there, and shall not be replaced; the first whose folder cannot be written to.
pub fn check<'a>(paths: impl IntoIterator<Item = Option<&'a Path>>) -> Result<(), FileError> {
    let mut before: Vec<PathBuf> = Vec::new();
    for path in paths.into_iter().flatten() {
        if std::fs::metadata(path).is_ok_and(|kind| !kind.is_file() && !kind.is_dir()) {
            continue;
        }
        let place = resolved(path);
        if before.contains(&place) {
            let problem = "two results are to be written to this file: give each a file of its own";
            return Err(FileError::whole(path, Problem::Syntax(problem.into())));
        }
        before.push(place);
        create(path).map_err(|error| FileError::whole(path, error))?;
    }
    Ok(())
}

/// The same of a command that reads these files: none of them gives way to a result, not even with `--force`.
///
/// Errors: a result that is one of the files read; as [`check`].
pub fn check_beside<'a>(
    read: impl IntoIterator<Item = &'a Path>,
    paths: impl IntoIterator<Item = Option<&'a Path>>,
) -> Result<(), FileError> {
    let read: Vec<PathBuf> = read.into_iter().map(resolved).collect();
    let paths: Vec<&Path> = paths.into_iter().flatten().collect();
    if let Some(path) = paths.iter().find(|path| read.contains(&resolved(path))) {
        let problem = "this file is read by the same command: give the result another name";
        return Err(FileError::whole(path, Problem::Syntax(problem.into())));
    }
    check(paths.into_iter().map(Some))
}

/// The one path of a file, whatever it is called by; of one that is not there, its name in its folder's.
fn resolved(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let of_new = || Some(folder.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(of_new).unwrap_or_else(|| path.to_owned())
}

/// Says on stderr what the user should know of the result.
pub fn warn(doubt: impl std::fmt::Display) {
    eprintln!("north: warning: {doubt}");
}

/// stdout for people.
pub fn people() -> People<io::Stdout> {
    People { to: io::stdout(), columns: columns(io::stdout().is_terminal()), line: Vec::new() }
}

/// Text that may be lost where its reader has gone.
struct ReadOrNot<W: Write>(W);

impl<W: Write> Write for ReadOrNot<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        read_or_not(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        read_or_not(self.0.flush(), ())
    }
}

fn read_or_not<T>(written: io::Result<T>, otherwise: T) -> io::Result<T> {
    match written {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(otherwise),
        written => written,
    }
}

/// Columns of a terminal; `None` where there is none.
fn columns(terminal: bool) -> Option<usize> {
    let (width, _) = ratatui::crossterm::terminal::size().ok().filter(|_| terminal)?;
    (width > 0).then_some(width.into())
}

/// Text as a person may see it: no control character reaches the terminal, and no line is broken in the middle of a word.
#[derive(Debug)]
pub struct People<W: Write> {
    to: W,
    columns: Option<usize>,
    line: Vec<u8>,
}

impl<W: Write> Write for People<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for &byte in bytes {
            if byte == b'\n' {
                let line = shown(&String::from_utf8_lossy(&self.line), self.columns);
                self.line.clear();
                writeln!(self.to, "{line}")?;
            } else {
                self.line.push(byte);
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let line = shown(&String::from_utf8_lossy(&self.line), self.columns);
        self.line.clear();
        self.to.write_all(line.as_bytes())?;
        self.to.flush()
    }
}

impl<W: Write> Drop for People<W> {
    fn drop(&mut self) {
        // Whoever wants to know flushes.
        let _ = self.flush();
    }
}

/// A line without control characters, broken between words where it is longer than the terminal is wide. Rows of tables stay whole.
fn shown(line: &str, columns: Option<usize>) -> String {
    let line: String = line
        .chars()
        .map(|c| if c.is_control() && c != '\t' { c.escape_debug().to_string() } else { c.into() })
        .collect();
    match columns {
        Some(columns) if !line.starts_with('|') => {
            let options = textwrap::Options::new(columns).subsequent_indent("    ").break_words(false);
            textwrap::fill(&line, options)
        }
        _ => line,
    }
}

/// A message for stderr, the same.
pub fn message(text: &str) -> String {
    let columns = columns(io::stderr().is_terminal());
    text.lines().map(|line| shown(line, columns)).collect::<Vec<_>>().join("\n")
}

fn write_json(writer: &mut impl Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(&mut *writer, value).map_err(io::Error::from)?;
    writeln!(writer)?;
    writer.flush()
}

#[cfg(test)]
mod tests {
    use north_finder::health::{Fault, Flag};

    use super::*;

    /// Half a file is no file, and leaves the one that was there, and nothing beside it.
    #[test]
    fn a_file_appears_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let files = || std::fs::read_dir(folder.path()).unwrap().count();
        let mut file = create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(files(), 0);
        write(&path, "first").unwrap();
        assert_eq!(write(&path, "second").unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        check([Some(path.as_path())]).unwrap_err();
        check([Some(folder.path().join("none/b.txt").as_path())]).unwrap_err();
        check([None, Some(folder.path().join("b.txt").as_path())]).unwrap();
        // Whoever comes first has the name.
        let mut late = create(&folder.path().join("c.txt")).unwrap();
        late.write_all(b"late").unwrap();
        write(&folder.path().join("c.txt"), "early").unwrap();
        assert_eq!(late.finish().unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        assert_eq!((std::fs::read_to_string(&path).unwrap(), files()), ("first".into(), 2));
    }

    #[test]
    fn two_results_are_not_written_to_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.txt"), folder.path().join("b.txt"));
        check([Some(a.as_path()), Some(b.as_path())]).unwrap();
        let other_name = folder.path().join(".").join("a.txt");
        let error = check([Some(a.as_path()), None, Some(other_name.as_path())]).unwrap_err().to_string();
        assert!(error.contains("a.txt: two results"), "{error}");
        // A device takes as many as come.
        #[cfg(unix)]
        check([Some(Path::new("/dev/null")), Some(Path::new("/dev/null"))]).unwrap();
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_result_is_not_written_over_a_file_that_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let (read, new) = (folder.path().join("a.csv"), folder.path().join("b.csv"));
        std::fs::write(&read, "measured").unwrap();
        check_beside([read.as_path()], [None, Some(new.as_path())]).unwrap();
        let other_name = folder.path().join(".").join("a.csv");
        for result in [&read, &other_name] {
            let error =
                check_beside([read.as_path()], [Some(new.as_path()), Some(result.as_path())]).unwrap_err().to_string();
            assert!(error.contains("a.csv: this file is read by the same command"), "{error}");
        }
        assert!(check_beside([read.as_path()], [Some(new.as_path()); 2]).is_err());
    }

    /// /proc is a folder that takes no file, whoever asks.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_takes_no_file_is_told_from_one_that_is_not_there() {
        let of = |path: &str| check([Some(Path::new(path))]).unwrap_err().to_string();
        let taken = of("/proc/x.html");
        assert!(taken.contains("no file can be made in the folder /proc: ") && taken.contains("os error"), "{taken}");
        assert!(!taken.contains(".north-"), "{taken}");
        assert!(of("/proc/none/x.html").contains("there is no such folder"));
        let folder = tempfile::tempdir().unwrap();
        check_folder(&folder.path().join("new/and/below")).unwrap();
        check_folder(folder.path()).unwrap();
        assert!(check_folder(Path::new("/proc/x/y")).unwrap_err().to_string().contains("the folder /proc: "));
        std::fs::write(folder.path().join("file"), "").unwrap();
        assert_eq!(check_folder(&folder.path().join("file/x")).unwrap_err().kind(), io::ErrorKind::NotADirectory);
    }

    #[test]
    fn a_captured_result_is_what_stdout_would_carry() {
        let json = JsonOption { file: Some("-".into()) };
        let (captured, ended) = captured(|| json.write(&0.1_f64).is_ok());
        assert!(ended);
        assert_eq!(captured, b"0.1\n");
    }

    #[test]
    fn no_line_is_broken_in_a_word_at_80_columns() {
        let flags =
            Flag::ALL.iter().map(|flag| format!("{}: {}. To do: {}.", flag.name(), flag.meaning(), flag.remedy()));
        let faults =
            Fault::ALL.iter().map(|fault| format!("{}: {}. To do: {}.", fault.name(), fault.meaning(), fault.remedy()));
        for text in flags.chain(faults) {
            let mut people = People { to: Vec::new(), columns: Some(80), line: Vec::new() };
            writeln!(people, "{text}").unwrap();
            let written = String::from_utf8(std::mem::take(&mut people.to)).unwrap();
            assert!(written.lines().all(|line| line.chars().count() <= 80), "{written}");
            assert_eq!(written.split_whitespace().collect::<Vec<_>>(), text.split_whitespace().collect::<Vec<_>>());
        }
    }

    #[test]
    fn control_characters_never_reach_the_terminal() {
        let mut people = People { to: Vec::new(), columns: None, line: Vec::new() };
        // Escape, delete, the one-byte control sequence introducer in two pieces, a carriage return; a letter of two bytes stays.
        people.write_all(b"a\x1b[31mb\x7f\xc2").unwrap();
        people.write_all(b"\x9b1mc\rd \xc2\xb0\n").unwrap();
        let written = String::from_utf8(std::mem::take(&mut people.to)).unwrap();
        assert_eq!(written, "a\\u{1b}[31mb\\u{7f}\\u{9b}1mc\\rd °\n");
    }
}
