//! What goes out: standard output, files, and the words in which a command says why it failed.

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use studies::{NamedFigure, SCHEMA_VERSION};

/// Why a command did not do what it was asked.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The options or the input are wrong.
    Input(String),
    /// Something went wrong while it was at work.
    Work(String),
    /// Nobody reads standard output any more, as when `head` has had enough: nothing to be said.
    Unread,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(text) | Self::Work(text) => f.write_str(text),
            Self::Unread => f.write_str("nobody reads standard output"),
        }
    }
}

impl Failure {
    /// Whose fault it is that options or input are wrong.
    pub(crate) fn input(why: impl ToString) -> Self {
        Self::Input(why.to_string())
    }

    /// Why the work could not be done.
    pub(crate) fn work(why: impl ToString) -> Self {
        Self::Work(why.to_string())
    }

    /// Says so, and gives the process's exit code.
    pub(crate) fn report(self) -> ExitCode {
        let (text, code) = match self {
            Self::Input(text) => (text, 2),
            Self::Work(text) => (text, 1),
            Self::Unread => return ExitCode::from(1),
        };
        say(&format!("error: {text}"));
        ExitCode::from(code)
    }
}

/// A line on standard error; a terminal that is gone is no reason to panic.
pub(crate) fn say(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Columns for tables: what COLUMNS says, else the terminal on standard output; none if there is no such thing.
pub(crate) fn columns() -> Option<u16> {
    let told = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    told.filter(|columns| *columns > 0).or_else(terminal_columns)
}

#[cfg(unix)]
fn terminal_columns() -> Option<u16> {
    let size = rustix::termios::tcgetwinsize(std::io::stdout()).ok()?;
    (size.ws_col > 0).then_some(size.ws_col)
}

#[cfg(not(unix))]
fn terminal_columns() -> Option<u16> {
    None
}

/// Prints a JSON document on standard output, with the version of its schema.
pub(crate) fn print_json(document: &impl Serialize) -> Result<(), Failure> {
    print(&format!("{:#}\n", versioned(document)?))
}

/// The document with the version of its schema.
pub(crate) fn versioned(document: &impl Serialize) -> Result<Value, Failure> {
    let mut document = serde_json::to_value(document).map_err(Failure::work)?;
    without_negative_zero(&mut document);
    if let Some(object) = document.as_object_mut() {
        object.insert("schema_version".to_owned(), SCHEMA_VERSION.into());
    }
    Ok(document)
}

/// A zero has no sign for those who read.
fn without_negative_zero(value: &mut Value) {
    match value {
        Value::Number(number) if number.as_f64() == Some(0.0) && number.is_f64() => *value = json!(0.0),
        Value::Array(values) => values.iter_mut().for_each(without_negative_zero),
        Value::Object(fields) => fields.values_mut().for_each(without_negative_zero),
        _ => (),
    }
}

/// Prints to standard output; a reader that has gone away is a failure, not a panic.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    let done = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    done.map_err(|e| match e.kind() {
        ErrorKind::BrokenPipe => Failure::Unread,
        _ => Failure::Work(format!("standard output: {e}")),
    })
}

/// How much of long work is done, in these units, on standard error if that is a terminal.
pub(crate) fn progress(length: Option<u64>, units: &'static str) -> ProgressBar {
    let bar = length.map_or_else(ProgressBar::no_length, ProgressBar::new).with_message(units);
    match ProgressStyle::with_template("{wide_bar} {pos} of {len} {msg}, {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Files that do not exist yet: their names and what will stand in them.
pub(crate) type Files = Vec<(String, Vec<u8>)>;

/// Charts as SVG files.
pub(crate) fn drawn(figures: &[NamedFigure]) -> Files {
    figures.iter().map(|(name, figure)| (format!("{name}.svg"), figure.svg().into_bytes())).collect()
}

/// A folder for output that can be written to.
pub(crate) struct Folder(PathBuf);

impl Folder {
    /// Makes the folder if need be, and tries it, so that no work is done in vain.
    pub(crate) fn new(path: &Path) -> Result<Self, Failure> {
        if path.exists() && !path.is_dir() {
            let why = "this is no folder, and files are to be written into one";
            return Err(Failure::Input(format!("{}: {why}", path.display())));
        }
        let trial = path.join(format!(".motor-hub-{}", std::process::id()));
        let tried = std::fs::create_dir_all(path)
            .and_then(|()| std::fs::write(&trial, []))
            .and_then(|()| std::fs::remove_file(&trial));
        let failed =
            |e| Failure::Input(format!("{}: nothing can be written to this folder: {e}", path.display()));
        tried.map(|()| Self(path.to_owned())).map_err(failed)
    }

    /// Writes files to it; returns their paths.
    pub(crate) fn write_all(&self, files: Files) -> Result<Vec<PathBuf>, Failure> {
        let mut written = Vec::with_capacity(files.len());
        for (name, bytes) in files {
            let path = self.0.join(name);
            let done = std::fs::write(&path, bytes);
            done.map_err(|e| Failure::Work(format!("{}: {e}", path.display())))?;
            written.push(path);
        }
        written.sort();
        Ok(written)
    }
}

impl fmt::Display for Folder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.display().fmt(f)
    }
}
