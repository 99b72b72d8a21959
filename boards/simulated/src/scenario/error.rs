//! Errors of scenario files: what is wrong, and where.

use std::ops::Range;
use toml::Spanned;

/// Error of a scenario file that is refused.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Unreadable {
        /// Path of the file.
        file: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The scenario cannot be run.
    #[error("{file}:{line}:{column}: {message}")]
    Wrong {
        /// Path of the file.
        file: String,
        /// Line, counted from 1.
        line: usize,
        /// Column in characters, counted from 1.
        column: usize,
        /// What is wrong, and what is allowed.
        message: String,
    },
}

/// Text for the keys that every scenario has: the end of a message about one of these keys.
const NEEDED: &str = "; a scenario needs name, duration_s, battery = { emf_v, resistance_ohm } and motors = [{ label, motor }]";

/// An error, and the part of the text that is wrong.
#[derive(Debug)]
pub(super) struct Fault {
    /// Range of bytes in the text; `None` until [`At::at`] gives the range of the table that was being checked.
    span: Option<Range<usize>>,
    message: String,
}

pub(super) type Checked<T> = Result<T, Fault>;

impl Fault {
    /// An error of the TOML parser, or of a single value. A message that begins with "= " gets the key of the value in
    /// front.
    pub(super) fn of_toml(error: &toml::de::Error, text: &str) -> Self {
        let mut message = error.message().trim_end().replace('\n', "; ");
        let start = error.span().unwrap_or_default().start;
        // The parser names the first missing key of a table. The table of the whole file begins at 0.
        if start == 0 && message.starts_with("missing field") {
            message.push_str(NEEDED);
        }
        let key = if message.starts_with("= ") { key_of_value(text, start) } else { "" };
        Self { span: error.span(), message: format!("{key} {message}").trim_start().to_owned() }
    }

    pub(super) fn in_file(self, file: &str, text: &str) -> ScenarioError {
        let (line, column) = line_and_column(text, self.span.unwrap_or_default().start);
        ScenarioError::Wrong { file: file.to_owned(), line, column, message: self.message }
    }
}

impl<S: Into<String>> From<S> for Fault {
    fn from(message: S) -> Self {
        Self { span: None, message: message.into() }
    }
}

/// Adds a range of bytes in the text to an error that has no range yet.
pub(super) trait At<T> {
    fn at<S>(self, place: &Spanned<S>) -> Checked<T>;
}

impl<T, E: Into<Fault>> At<T> for Result<T, E> {
    fn at<S>(self, place: &Spanned<S>) -> Checked<T> {
        self.map_err(|error| {
            let fault = error.into();
            Fault { span: fault.span.or(Some(place.span())), ..fault }
        })
    }
}

/// The key of the value that begins at a byte of the text. The value may be in a list.
fn key_of_value(text: &str, at: usize) -> &str {
    let before = text.get(..at).unwrap_or_default();
    let key = before.rsplit_once('=').map_or(before, |(key, _)| key.trim_end());
    key.rsplit(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or(key)
}

/// Line and column of a byte of a text, counted from 1, columns in characters. A byte past the end counts as the end.
pub fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    (before.matches('\n').count() + 1, column)
}
