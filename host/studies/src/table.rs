//! Tables for a terminal, all in one look.
//!
//! ```
//! let mut table = studies::table::new(&["motor", "counts/s"], 1);
//! table.add_row(["fan", "1200"]);
//! assert!(table.to_string().contains("fan"));
//! ```

use comfy_table::{CellAlignment, Table, presets};

/// A table whose columns are aligned right, but for the first `left` of them.
pub fn new(headings: &[&str], left: usize) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_FULL_CONDENSED).set_header(headings.iter().copied());
    for column in table.column_iter_mut().skip(left) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
