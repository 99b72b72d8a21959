//! The text of a study: sentences and tables, for a terminal or as GitHub Markdown.
//!
//! ```
//! use studies::{page::Page, table};
//!
//! let mut table = table::new(&["motor", "settling"], 1);
//! table.add_row(["fan", "0.25 s"]);
//! let mut page = Page::new("The fan settles.");
//! page.table("Settling", table);
//! assert!(page.terminal().starts_with("The fan settles.\n\nSettling\n"));
//! let markdown = "The fan settles.\n\n## Settling\n\n| motor | settling |\n| :-- | --: |\n| fan | 0.25 s |\n";
//! assert_eq!(page.markdown(), markdown);
//! ```

use crate::table::{Table, one_line, paragraph};

/// A text of several parts, its result first.
#[derive(Clone, Debug)]
pub struct Page {
    parts: Vec<Part>,
}

#[derive(Clone, Debug)]
enum Part {
    Heading(String),
    Text(String),
    List(Vec<String>),
    Table(Table),
}

impl Page {
    /// A page that begins with the result in a sentence.
    pub fn new(headline: impl Into<String>) -> Self {
        Self { parts: vec![Part::Text(headline.into())] }
    }

    /// Adds a heading.
    pub fn heading(&mut self, text: &str) {
        self.parts.push(Part::Heading(text.to_owned()));
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: &str) {
        self.parts.push(Part::Text(text.to_owned()));
    }

    /// Adds sentences, each on a line of its own.
    pub fn list(&mut self, sentences: impl IntoIterator<Item = String>) {
        self.parts.push(Part::List(sentences.into_iter().collect()));
    }

    /// Adds a table under a caption.
    pub fn table(&mut self, caption: &str, table: Table) {
        self.heading(caption);
        self.parts.push(Part::Table(table));
    }

    /// The page for a terminal, no wider than the terminal.
    pub fn terminal(&self) -> String {
        let mut out = String::new();
        for part in &self.parts {
            match part {
                Part::Heading(text) => out.push_str(&paragraph(text)),
                Part::Text(text) => out.push_str(&format!("{}\n", paragraph(text))),
                Part::List(lines) => {
                    let lines: Vec<String> =
                        lines.iter().map(|line| paragraph(&format!("* {line}"))).collect();
                    out.push_str(&format!("{}\n", lines.join("\n")));
                }
                Part::Table(table) => out.push_str(&format!("{table}\n")),
            }
            out.push('\n');
        }
        out
    }

    /// The page as GitHub Markdown.
    pub fn markdown(&self) -> String {
        let part = |part: &Part| match part {
            Part::Heading(text) => format!("## {text}\n"),
            Part::Text(text) => format!("{}\n", one_line(text)),
            Part::List(lines) => lines.iter().map(|line| format!("* {}\n", one_line(line))).collect(),
            Part::Table(table) => table.markdown(),
        };
        self.parts.iter().map(part).collect::<Vec<_>>().join("\n")
    }
}
