//! `cargo xtask results`: writes the pages in `docs/results` from tables that programs and tests have measured.

use crate::IMAGES;
use crate::generated::Generated;
use crate::tool::{Failed, REPORTS, cargo, motor_hub, root};
use std::fs;

/// The folder of the pages.
const SHOWN: &str = "docs/results";

/// The folder into which programs and tests write their tables.
const MADE: &str = "target/results";

/// A page: its file, its heading, and the tables below the heading.
struct Page {
    file: &'static str,
    head: &'static str,
    parts: &'static [&'static str],
}

const PAGES: [Page; 5] = [
    Page {
        file: "comparison.md",
        head: "# Comparison of schemes, duty rules and regulators\n\nMade by `motor-hub compare`.",
        parts: &["compare/tables.md"],
    },
    Page {
        file: "survey.md",
        head: "# How well motors are regulated\n\nMade by `motor-hub survey --seed 20261121`.",
        parts: &["survey/tables.md"],
    },
    Page {
        file: "square.md",
        head: "# Heading of a drive base\n\nMade by `cargo test -p studies --test square -- --include-ignored`.",
        parts: &["square.md"],
    },
    Page {
        file: "fault-matrix.md",
        head: "# Fault matrix\n\n\
               Every fault in four modes at once, on the emulated chip of the NUCLEO-F429ZI. \
               Times run from the fault until the bridge is open or the motor is shorted. Otherwise the cell gives \
               the speed of the motor at the end of the fault, or on average. \
               Made by `cargo xtask test nucleo-f429zi`, tests `matrix`.",
        parts: &["nucleo-f429zi/matrix-as-they-come.md", "nucleo-f429zi/matrix-by-model-braking.md"],
    },
    Page {
        file: "budgets.md",
        head: "# Budgets\n\n\
               Instructions are counted on emulated chips, where each takes one cycle: they are no times of a real chip. \
               Made by `cargo xtask size` and `cargo xtask test`, tests `budget` and `boot`.",
        parts: &[
            "size.md",
            "nucleo-f429zi/hub-50-ms.md",
            "nucleo-f429zi/hub-1-ms.md",
            "nucleo-f429zi/step.md",
            "nucleo-f429zi/regulator.md",
        ],
    },
];

/// With `--measured` as the last argument the task takes the tables that earlier tests have written.
pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let (is_measured, arguments) = match arguments {
        [arguments @ .., last] if last == "--measured" => (true, arguments),
        arguments => (false, arguments),
    };
    let mut pages = Generated::new("results", arguments)?;
    for (command, out) in [(&["compare"][..], "compare"), (&["survey", "--seed", "20261121"], "survey")] {
        motor_hub(&[command, &["--out", &format!("{MADE}/{out}")]].concat())?;
    }
    if !is_measured {
        measure()?;
    }
    crate::size::task(&[])?;
    for page in &PAGES {
        let mut text = format!("{}\nDo not edit: `cargo xtask results` writes this page.\n", page.head);
        for part in page.parts {
            let file = root().join(MADE).join(part);
            let part = fs::read_to_string(&file).map_err(|error| Failed::at(&file, error))?;
            text.push('\n');
            text.push_str(&part);
        }
        pages.take(&format!("{SHOWN}/{}", page.file), text.as_bytes())?;
    }
    pages.end()
}

/// Runs the tests that write tables.
fn measure() -> Result<(), Failed> {
    // Without the name of a package the test uses the crates that `cargo test` has built.
    cargo(&["test", "--test", "square", "--", "--include-ignored"])?;
    let measured =
        ["every_fault_in", "faults_of_motors", "within_the_budget", "by_itself_takes", "little_of_the_core"];
    cargo(&[&IMAGES[..], &["--"], &measured, &["--include-ignored", "--skip", REPORTS]].concat())
}
