//! Checks that the files exist that documents link to, and that the code in the guide to boards is compiled.

#[path = "common/repository.rs"]
mod repository;

use repository::{files, read};

/// Returns the anchor by which a link names a heading.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    text.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c)).collect::<String>().replace(' ', "-")
}

#[test]
fn links_lead_to_files_and_headings_that_are_there() {
    let mut broken = Vec::new();
    for document in files(".", "md") {
        let text = read(&document);
        for link in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(link, _)| link) {
            if link.contains("://") {
                continue;
            }
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { document.clone() } else { document.with_file_name(file) };
            let there = if heading.is_empty() {
                target.exists()
            } else {
                read(&target).lines().any(|line| line.starts_with('#') && anchor(line) == heading)
            };
            if !there {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
}

#[test]
fn the_code_of_the_guide_to_boards_is_that_of_the_example_which_is_compiled() {
    let guide = read("docs/guides/port-a-board.md");
    let example = read("examples/two_motors.rs");
    let blocks: Vec<&str> = guide
        .split("```rust\n")
        .skip(1)
        .filter_map(|rest| rest.split_once("```"))
        .map(|(code, _)| code)
        .collect();
    assert!(!blocks.is_empty(), "the guide shows no code");
    for block in blocks {
        assert!(example.contains(block), "not in examples/two_motors.rs:\n{block}");
    }
}
