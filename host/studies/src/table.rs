//! Tables for a terminal, no wider than the terminal, or as Markdown. Text wraps at its words. Number columns that do
//! not fit go into a further table below, which repeats the text columns.
//!
//! ```
//! let mut table = studies::table::new(&["motor", "counts/s"], 1);
//! table.add_row(["fan", "1200"]);
//! assert!(table.to_string().contains("fan"));
//! ```

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table as Drawn, Width, presets};
use std::fmt;
use std::sync::atomic::{AtomicU16, Ordering};

/// Width in columns that is assumed for a terminal of unknown width.
pub const USUAL_WIDTH: u16 = 80;

/// Width of the terminal in columns: one for all tables of the process.
static WIDTH: AtomicU16 = AtomicU16::new(USUAL_WIDTH);

/// Sets the width of the terminal in columns. Tables that are written afterwards are no wider.
pub fn fit(columns: u16) {
    WIDTH.store(columns, Ordering::Relaxed);
}

/// Rows under headings.
#[derive(Clone, Debug)]
pub struct Table {
    headings: Vec<String>,
    /// Number of text columns, aligned left; all others are numbers.
    left: usize,
    rows: Vec<Vec<String>>,
    /// Characters that every column has at least, where there is room.
    narrowest: usize,
}

/// Creates a table whose first `left` columns are aligned left, and whose other columns are aligned right.
pub fn new(headings: impl IntoIterator<Item: ToString>, left: usize) -> Table {
    let headings = headings.into_iter().map(|heading| heading.to_string()).collect();
    Table { headings, left, rows: Vec::new(), narrowest: 0 }
}

/// A column of a table: its heading, and the function that returns the text of an item.
type Column<'a, T> = (&'a str, &'a dyn Fn(&T) -> String);

/// Creates a table with a row for each item.
pub(crate) fn of<T>(items: impl IntoIterator<Item = T>, left: usize, columns: &[Column<'_, T>]) -> Table {
    let mut table = new(columns.iter().map(|(heading, _)| heading), left);
    for item in items {
        table.add_row(columns.iter().map(|(_, text)| text(&item)));
    }
    table
}

impl Table {
    /// Adds a row; a number that rounds to zero has no sign.
    pub fn add_row(&mut self, cells: impl IntoIterator<Item: ToString>) -> &mut Self {
        self.rows.push(cells.into_iter().map(|cell| without_negative_zero(&cell.to_string())).collect());
        self
    }

    /// The table with columns of at least this many characters, so that several tables line up.
    #[must_use]
    pub fn at_least(self, narrowest: usize) -> Self {
        Self { narrowest, ..self }
    }

    /// The table as GitHub Markdown. The lines of a cell become one line.
    pub fn markdown(&self) -> String {
        let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let plain = |cell: &String| one_line(cell).replace('|', "\\|");
        let sides = (0..self.headings.len()).map(|index| if index < self.left { ":--" } else { "--:" });
        let mut out = row(self.headings.iter().map(plain).collect());
        out += &row(sides.map(str::to_owned).collect());
        self.rows.iter().for_each(|cells| out += &row(cells.iter().map(plain).collect()));
        out
    }

    fn column(&self, index: usize) -> impl Iterator<Item = &str> {
        self.rows.iter().filter_map(move |row| row.get(index)).map(String::as_str)
    }

    /// Width in characters of a column without wrapping, and the least width that breaks no word, number or line.
    fn widths(&self, index: usize) -> [usize; 2] {
        let heading = self.headings.get(index).map_or("", String::as_str);
        let most = self.column(index).chain([heading]).flat_map(str::lines).map(chars).max().unwrap_or(0);
        let words = |text: &'_ str| text.split_whitespace().map(chars).max().unwrap_or(0);
        // A cell of several lines does not wrap, because its lines belong beside the lines of other cells.
        let whole = |text: &str| {
            let wraps = index < self.left && !text.contains('\n');
            if wraps { words(text) } else { text.lines().map(chars).max().unwrap_or(0) }
        };
        let least = self.column(index).map(whole).max().unwrap_or(0).max(words(heading));
        [most.max(self.narrowest), least]
    }

    /// The columns of each table. There is one table if wrapping the text makes it narrow enough. Otherwise there are
    /// several tables, each with the text columns.
    fn parts(&self, room: usize) -> Vec<Vec<usize>> {
        let all = self.headings.len();
        let least: usize = (0..all).map(|column| self.widths(column)[1]).sum();
        if least + frame(all) <= room {
            return vec![(0..all).collect()];
        }
        let keys: Vec<usize> = (0..if self.left < all { self.left } else { 1 }).collect();
        let mut parts: Vec<Vec<usize>> = Vec::new();
        let mut part = keys.clone();
        for index in keys.len()..all {
            let with = [&part[..], &[index]].concat();
            let most: usize = with.iter().map(|&column| self.widths(column)[0]).sum();
            if most + frame(with.len()) > room && part.len() > keys.len() {
                parts.push(std::mem::replace(&mut part, [&keys[..], &[index]].concat()));
            } else {
                part = with;
            }
        }
        parts.push(part);
        parts
    }

    fn draw(&self, columns: &[usize], room: usize) -> Drawn {
        let cells = |row: &[String]| -> Vec<String> {
            columns.iter().map(|&column| row.get(column).cloned().unwrap_or_default()).collect()
        };
        let mut drawn = Drawn::new();
        drawn.load_style(presets::UTF8_FULL_CONDENSED).set_header(cells(&self.headings));
        drawn.add_rows(self.rows.iter().map(|row| cells(row)));
        drawn.set_content_arrangement(ContentArrangement::Dynamic).set_width(u16::MAX);
        let widths = narrowed(columns.iter().map(|&column| self.widths(column)).collect(), room);
        for ((column, index), width) in drawn.column_iter_mut().zip(columns).zip(widths) {
            let width = u16::try_from(width + PADDING).unwrap_or(u16::MAX);
            column.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width)));
            if *index >= self.left {
                column.set_cell_alignment(CellAlignment::Right);
            }
        }
        drawn
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let room = usize::from(WIDTH.load(Ordering::Relaxed));
        for (number, columns) in self.parts(room).iter().enumerate() {
            let gap = if number > 0 { "\n" } else { "" };
            write!(f, "{gap}{}", self.draw(columns, room))?;
        }
        Ok(())
    }
}

/// A whole number with its digits in groups of three: "29 376".
pub fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let groups: Vec<&str> = digits
        .as_bytes()
        .rchunks(3)
        .rev()
        .map(|group| std::str::from_utf8(group).unwrap_or_default())
        .collect();
    groups.join(" ")
}

/// Seconds as text; "never" without a time.
pub fn seconds(seconds: Option<f64>) -> String {
    seconds.filter(|seconds| seconds.is_finite()).map_or("never".to_owned(), |s| format!("{s:.2} s"))
}

/// A percentage as text; "-" without a number.
pub(crate) fn percent(percent: Option<f64>) -> String {
    percent.map_or("-".to_owned(), |percent| format!("{percent:.1} %"))
}

/// The words of a text in one line.
pub(crate) fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A paragraph of words, no wider than the terminal.
pub fn paragraph(text: &str) -> String {
    filled(text, usize::from(WIDTH.load(Ordering::Relaxed)))
}

fn filled(text: &str, room: usize) -> String {
    let (mut out, mut column) = (String::with_capacity(text.len()), 0);
    for word in text.split_whitespace() {
        if column > 0 {
            let fits = column + 1 + chars(word) <= room;
            out.push(if fits { ' ' } else { '\n' });
            column = if fits { column + 1 } else { 0 };
        }
        out.push_str(word);
        column += chars(word);
    }
    out
}

/// Number of spaces on both sides of a cell, in total.
const PADDING: usize = 2;

/// Characters of a row that are frame and padding.
const fn frame(columns: usize) -> usize {
    (PADDING + 1) * columns + 1
}

/// Narrows the widest column that can be narrower, until the table fits or no column can be narrower.
fn narrowed(mut widths: Vec<[usize; 2]>, room: usize) -> Vec<usize> {
    let frame = frame(widths.len());
    while widths.iter().map(|[width, _]| width).sum::<usize>() + frame > room {
        let spare = widths.iter_mut().filter(|[width, least]| width > least);
        let Some([width, _]) = spare.max_by_key(|[width, _]| *width) else { break };
        *width -= 1;
    }
    widths.into_iter().map(|[width, _]| width).collect()
}

fn chars(text: &str) -> usize {
    text.chars().count()
}

/// The text without the signs of numbers that are zero, such as "-0.00".
pub(crate) fn without_negative_zero(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for (at, c) in text.char_indices() {
        let (before, after) = text.split_at(at);
        let number = after.trim_start_matches('-').split(|c: char| !c.is_ascii_digit() && c != '.').next();
        let zero = number.is_some_and(|n| n.starts_with('0') && n.chars().all(|c| matches!(c, '0' | '.')));
        let alone = !before.ends_with(char::is_alphanumeric);
        if !(c == '-' && zero && alone) {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widest(table: &Table, room: usize) -> usize {
        let parts = table.parts(room).into_iter();
        let lines = parts.map(|columns| table.draw(&columns, room).to_string());
        lines.flat_map(|drawn| drawn.lines().map(chars).collect::<Vec<_>>()).max().unwrap_or(0)
    }

    #[test]
    fn a_paragraph_fills_its_lines_and_is_no_wider_than_the_room_unless_a_word_is() {
        assert_eq!(filled("one two\nthree four", 9), "one two\nthree\nfour");
        assert_eq!(filled("one two three four", 10), "one two\nthree four");
        assert_eq!(filled("a counterelectromotive force", 8), "a\ncounterelectromotive\nforce");
        assert_eq!(filled(" ", 8), "");
    }

    #[test]
    fn what_never_happens_has_no_seconds() {
        assert_eq!([Some(0.25), Some(f64::INFINITY), None].map(seconds), ["0.25 s", "never", "never"]);
        assert_eq!([0, 999, 29_376, 1_000_000].map(grouped), ["0", "999", "29 376", "1 000 000"]);
    }

    #[test]
    fn a_cell_of_markdown_is_one_line_without_a_bar() {
        let mut table = new(&["task", "|error|"], 1);
        table.add_row(["two\n  lines", "-0.0"]);
        assert_eq!(table.markdown(), "| task | \\|error\\| |\n| :-- | --: |\n| two lines | 0.0 |\n");
    }

    #[test]
    fn a_number_that_rounds_to_zero_has_no_sign() {
        for (text, is) in [
            ("-0.00", "0.00"),
            ("-0 / -0.0 %", "0 / 0.0 %"),
            ("-0.01", "-0.01"),
            ("[-0.0 +3.0]", "[0.0 +3.0]"),
            ("2026-01-0", "2026-01-0"),
            ("-10", "-10"),
            ("-", "-"),
        ] {
            assert_eq!(without_negative_zero(text), is);
        }
    }

    #[test]
    fn a_table_is_no_wider_than_its_terminal_and_breaks_no_number() {
        let headings = ["variant", "settling", "overshoot in percent", "rms error", "returned", "last"];
        let mut table = new(&headings, 1);
        table.add_row(["A, linear current", "1.90 s", "13.40 %", "258.6 counts/s", "0.86 J", "-0.00"]);
        for room in [40, 50, 60, 80, 120] {
            assert!(widest(&table, room) <= room, "{room}\n{table}");
            let parts = table.parts(room).into_iter();
            let drawn: String = parts.map(|columns| table.draw(&columns, room).to_string()).collect();
            for cell in ["1.90 s", "13.40 %", "258.6 counts/s", "0.86 J", "current"] {
                assert!(drawn.contains(cell), "{room}: {cell}\n{drawn}");
            }
        }
        assert_eq!((table.parts(120).len(), table.parts(80).len()), (1, 1));
    }

    #[test]
    fn lines_of_a_cell_stay_beside_those_of_its_neighbours() {
        let mut table = new(&["what", "was"], 1);
        table.add_row(["deceleration jerk, worst\n  of all of them", "1 A\n2 A"]);
        let drawn = table.draw(&[0, 1], 20).to_string();
        assert!(drawn.lines().any(|line| line.contains("worst") && line.contains("1 A")), "{drawn}");
    }
}
