//! Pages that have a part written by these tests: the explanations of faults, and the table of settings.
//! `UPDATE_SNAPSHOTS=1` writes these parts.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

use motor_hub_client::explanations::explanation;
use motor_hub_client::motor_hub::extension::settings::{Field, Form, Group, Zero};
use motor_hub_client::motor_hub::record::Fault;
use motor_hub_client::request_text::of_group;
use std::fmt::Write;
use std::path::Path;

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

/// Checks that a page of `docs` is as `expected` makes it from the present page, or writes the page.
fn check(page: &str, expected: impl FnOnce(&str) -> String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(page);
    let present = std::fs::read_to_string(&path).unwrap();
    let expected = expected(&present);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some_and(|value| value == "1") {
        return std::fs::write(path, expected).unwrap();
    }
    assert!(
        present == expected,
        "docs/{page} is stale: UPDATE_SNAPSHOTS=1 cargo test -p motor-hub-client --test generated_pages writes the page"
    );
}

#[test]
fn the_page_of_fault_numbers_has_the_explanations_that_programs_show() {
    check("reference/fault-numbers.md", |page| {
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
        expected
    });
}

#[test]
fn the_page_of_settings_has_every_setting_with_its_allowed_values() {
    check("guides/settings.md", |page| {
        const HEAD: &str = "| setting of a motor | allowed | in a packet |\n|---|---|---|\n";
        let (before, rest) = page.split_once(HEAD).expect("the page has the table");
        let (_, after) = rest.split_once("\n\n").expect("the table ends");
        let mut rows = String::new();
        for group in Group::ALL {
            writeln!(rows, "| **{}** | | |", of_group(group)).unwrap();
            for field in group.fields() {
                let (allowed, packet) = (allowed(field), in_packet(field));
                writeln!(rows, "| `{}` | {allowed} | {packet} |", field.name).unwrap();
            }
        }
        [before, HEAD, &rows, "\n", after].concat()
    });
}

/// The values of a setting in a settings file.
fn allowed(field: &Field) -> String {
    match field.form {
        Form::Words(words) => words.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(", "),
        Form::Steps(_) => {
            let (least, most) = field.range();
            format!("{} to {}", decimal(least), decimal(most))
        }
    }
}

/// The integer of a setting in a packet.
fn in_packet(field: &Field) -> String {
    let mut text = format!("{}{}", if field.signed { "i" } else { "u" }, 8 * field.size);
    match field.form {
        Form::Words(_) => text.push_str(", the number of the word from 0"),
        Form::Steps(1) => (),
        Form::Steps(steps) => write!(text, ", steps of 1/{steps}").unwrap(),
    }
    text.push_str(match field.zero {
        Zero::Value => "",
        Zero::NotConfigured => "; 0: not configured",
        Zero::Keeps => "; 0: unchanged",
    });
    if let Some(version) = field.since {
        write!(text, "; since {version}").unwrap();
    }
    text
}

/// A number with at most seven decimals.
fn decimal(number: f64) -> String {
    format!("{number:.7}").trim_end_matches('0').trim_end_matches('.').to_owned()
}
