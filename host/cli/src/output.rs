//! Writes to standard output and to files, and prints the messages of commands that fail.

use indicatif::{ProgressBar, ProgressStyle};
use motor_hub_client::Error;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
#[cfg(unix)]
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use studies::{NamedFigure, SCHEMA_VERSION};
use terminal_size::{Width, terminal_size_of};

/// Why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The options or the input are wrong.
    Input(String),
    /// The command failed for another reason than its options or input.
    Work(String),
    /// A hub does not answer, or refuses a request. `HubOptions::explain` adds the place of the hub to the message.
    Hub(Error),
    /// The command received this signal, given by its name such as "Ctrl-C".
    Stopped(&'static str),
    /// The reader of standard output, such as `head`, has closed it. No message is printed.
    OutputClosed,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(text) | Self::Work(text) => f.write_str(text),
            Self::Hub(error) => error.fmt(f),
            Self::Stopped(signal) => write!(f, "stopped by {signal}"),
            Self::OutputClosed => f.write_str("standard output is closed"),
        }
    }
}

impl Failure {
    pub(crate) fn input(why: impl ToString) -> Self {
        Self::Input(why.to_string())
    }

    pub(crate) fn work(why: impl ToString) -> Self {
        Self::Work(why.to_string())
    }

    /// Prints the message on standard error, and returns the process's exit code.
    pub(crate) fn report(self) -> ExitCode {
        if !matches!(self, Self::OutputClosed) {
            print_error_line(&format!("error: {self}"));
        }
        ExitCode::from(if matches!(self, Self::Input(_)) { 2 } else { 1 })
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Hub(error)
    }
}

/// Prints a line on standard error. A closed terminal is no error.
pub(crate) fn print_error_line(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Returns the number of columns for tables: the variable COLUMNS, otherwise the width of the terminal on standard
/// output. `None` without the variable and without a terminal.
pub(crate) fn columns() -> Option<u16> {
    let set = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    let of_terminal = || terminal_size_of(io::stdout()).map(|(Width(columns), _)| columns);
    set.filter(|columns| *columns > 0).or_else(of_terminal)
}

/// Prints a JSON document on standard output, with the version of its schema.
pub(crate) fn print_json(document: &impl Serialize) -> Result<(), Failure> {
    print(&format!("{:#}\n", versioned(document)?))
}

/// Prints the document as JSON if `json` is true, otherwise the text and a line feed.
pub(crate) fn print_as(
    json: bool,
    document: &impl Serialize,
    text: impl fmt::Display,
) -> Result<(), Failure> {
    if json { print_json(document) } else { print(&format!("{text}\n")) }
}

/// Returns the document with the version of its schema, and without negative zeros.
pub(crate) fn versioned(document: &impl Serialize) -> Result<Value, Failure> {
    let mut document = serde_json::to_value(document).map_err(Failure::work)?;
    without_negative_zero(&mut document);
    if let Some(object) = document.as_object_mut() {
        object.insert("schema_version".to_owned(), SCHEMA_VERSION.into());
    }
    Ok(document)
}

/// Removes the sign of negative zeros.
fn without_negative_zero(value: &mut Value) {
    match value {
        Value::Number(number) if number.as_f64() == Some(0.0) && number.is_f64() => *value = json!(0.0),
        Value::Array(values) => values.iter_mut().for_each(without_negative_zero),
        Value::Object(fields) => fields.values_mut().for_each(without_negative_zero),
        _ => (),
    }
}

/// Prints to standard output. A closed standard output is a failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let done = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    done.map_err(|e| match e.kind() {
        ErrorKind::BrokenPipe => Failure::OutputClosed,
        _ => Failure::Work(format!("standard output: {e}")),
    })
}

/// Fails if the reader of standard output has closed it. Windows reports that only to a program that prints.
pub(crate) fn check_reader() -> Result<(), Failure> {
    #[cfg(unix)]
    {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};
        let out = io::stdout();
        let mut out = [PollFd::new(&out, PollFlags::empty())];
        let polled = poll(&mut out, Some(&Timespec::default()));
        if polled.is_ok() && out.iter().any(|out| out.revents().intersects(PollFlags::ERR | PollFlags::HUP)) {
            return Err(Failure::OutputClosed);
        }
    }
    Ok(())
}

/// Returns a progress bar that shows `units`. The bar is visible only if standard error is a terminal.
pub(crate) fn progress(length: Option<u64>, units: &'static str) -> ProgressBar {
    let bar = length.map_or_else(ProgressBar::no_length, ProgressBar::new).with_message(units);
    match ProgressStyle::with_template("{wide_bar} {pos} of {len} {msg}, {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Runs `work` with a progress bar that shows `units`. `work` calls its argument with the number of steps done and the
/// number of all steps.
pub(crate) fn in_steps<T>(units: &'static str, work: impl FnOnce(&mut dyn FnMut(usize, usize)) -> T) -> T {
    let bar = progress(None, units);
    let done = work(&mut |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    done
}

/// Writes a file. A file that exists keeps its content until the new file is complete, for example on a full disk.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let written = match fs::canonicalize(path) {
        // A device or a pipe cannot be replaced.
        Ok(old) if !old.is_file() => fs::write(old, bytes),
        // A symbolic link stays, and the file is replaced that it names.
        Ok(old) => replace(&old, bytes).or_else(|error| match error.kind() {
            // The folder takes no second file, or the file is a mount of its own.
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem | ErrorKind::ResourceBusy => {
                fs::write(old, bytes)
            }
            _ => Err(error),
        }),
        Err(_) => fs::write(path, bytes),
    };
    written.map_err(|e| Failure::Work(format!("{}: {e}", path.display())))
}

/// Replaces a file to which this program may write. The new file has the owner and the permissions of the old one.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let old = OpenOptions::new().write(true).open(path)?.metadata()?;
    let new = path.with_file_name(format!(".motor-hub-{}", std::process::id()));
    let replaced = File::create(&new).and_then(|mut file| {
        file.write_all(bytes)?;
        // Another owner is given by the superuser only.
        #[cfg(unix)]
        let _ = std::os::unix::fs::fchown(&file, Some(old.uid()), Some(old.gid()));
        file.set_permissions(old.permissions())?;
        // Some file systems report a full disk only now.
        file.sync_all()?;
        fs::rename(&new, path)
    });
    if replaced.is_err() {
        let _ = fs::remove_file(&new);
    }
    replaced
}

/// Files to write: their names and contents.
pub(crate) type Files = Vec<(String, Vec<u8>)>;

pub(crate) fn drawn(figures: &[NamedFigure]) -> Files {
    figures.iter().map(|(name, figure)| (format!("{name}.svg"), figure.svg().into_bytes())).collect()
}

/// A folder for output, to which this program can write.
pub(crate) struct Folder(PathBuf);

impl Folder {
    /// Creates the folder if it does not exist. Writes and removes an empty file, so that a folder without write
    /// permission is found before the work.
    pub(crate) fn new(path: &Path) -> Result<Self, Failure> {
        if path.exists() && !path.is_dir() {
            return Err(Failure::Input(format!(
                "{}: not a folder; give a folder for the files",
                path.display()
            )));
        }
        let trial = path.join(format!(".motor-hub-{}", std::process::id()));
        let tried = fs::create_dir_all(path)
            .and_then(|()| fs::write(&trial, []))
            .and_then(|()| fs::remove_file(&trial));
        let failed =
            |e| Failure::Input(format!("{}: nothing can be written to this folder: {e}", path.display()));
        tried.map(|()| Self(path.to_owned())).map_err(failed)
    }

    /// Writes files to the folder, and returns their paths.
    pub(crate) fn write_all(&self, files: Files) -> Result<Vec<PathBuf>, Failure> {
        let mut written = Vec::with_capacity(files.len());
        for (name, bytes) in files {
            let path = self.0.join(name);
            write_file(&path, &bytes)?;
            written.push(path);
        }
        Ok(written)
    }

    /// Prints the text, writes the files, and says where they are: `what` is such as "Charts (SVG) are". With `json`
    /// instead writes the files, and prints the document that `json` returns for their paths. JSON holds Unicode only:
    /// bytes of a path that are not Unicode become U+FFFD.
    pub(crate) fn publish(
        &self,
        files: Files,
        what: &str,
        text: &str,
        json: Option<impl FnOnce(&[String]) -> Value>,
    ) -> Result<(), Failure> {
        if let Some(document) = json {
            let written = self.write_all(files)?;
            let paths: Vec<String> = written.iter().map(|path| path.to_string_lossy().into_owned()).collect();
            return print_json(&document(&paths));
        }
        print(text)?;
        self.write_all(files)?;
        print(&format!("{what} in {self}\n"))
    }
}

/// Prints the paths of files, one a line.
pub(crate) fn print_paths(files: &[PathBuf]) -> Result<(), Failure> {
    files.iter().try_for_each(|file| print(&format!("{}\n", file.display())))
}

impl fmt::Display for Folder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.display().fmt(f)
    }
}
