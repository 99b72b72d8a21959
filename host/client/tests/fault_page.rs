//! The page of fault numbers has the explanations that programs show. `UPDATE_SNAPSHOTS=1` writes the page's sections.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

use motor_hub_client::explanations::explanation;
use motor_hub_client::motor_hub::record::Fault;
use std::fmt::Write;

/// Longest line of the page.
const COLUMNS: usize = 118;

fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().unwrap();
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= COLUMNS {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines.join("\n")
}

#[test]
fn the_page_of_fault_numbers_has_the_explanations_that_programs_show() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/fault-numbers.md");
    let page = std::fs::read_to_string(path).unwrap();
    let (head, _) = page.split_once("\n## ").unwrap();
    let mut expected = format!("{}\n", head.trim_end());
    for fault in Fault::ALL {
        let of = explanation(*fault);
        write!(expected, "\n## {}: {}\n", fault.number(), fault.name()).unwrap();
        for paragraph in [
            format!("**Means.** {}", of.means),
            format!("**The hub** {}", of.hub),
            format!("**Look at** {}", of.look_at),
        ] {
            write!(expected, "\n{}\n", wrapped(&paragraph)).unwrap();
        }
    }
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some_and(|value| value == "1") {
        return std::fs::write(path, expected).unwrap();
    }
    assert_eq!(
        page, expected,
        "UPDATE_SNAPSHOTS=1 cargo test -p motor-hub-client --test fault_page writes the page"
    );
}
