//! `motor-hub paper`, `figures`, `completions` and `man`: documents about the paper, and about this program.

use crate::output::{Failure, Files, Folder, drawn, print, print_json, print_paths};
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;
use std::path::Path;
use studies::paper::Document;

pub(crate) fn paper(json: bool) -> Result<(), Failure> {
    let document = Document::new().map_err(Failure::work)?;
    if json { print_json(&document) } else { print(&document.text()) }
}

pub(crate) fn figures(out: &Path) -> Result<(), Failure> {
    let folder = Folder::new(out)?;
    let figures = studies::figures::all().map_err(Failure::work)?;
    let mut files = drawn(&figures);
    files.push(("14-circuits.svg".into(), studies::figures::CIRCUITS.into()));
    print_paths(&folder.write_all(files)?)
}

pub(crate) fn completions(shell: Shell, mut command: Command) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, "motor-hub", &mut script);
    print(&String::from_utf8(script).map_err(Failure::work)?)
}

pub(crate) fn man(out: &Path, mut command: Command) -> Result<(), Failure> {
    let folder = Folder::new(out)?;
    command.build();
    let mut pages = Files::new();
    add_page(&command, &mut pages)?;
    print_paths(&folder.write_all(pages)?)
}

/// Adds the manual page of a command and the pages of its subcommands.
fn add_page(command: &Command, pages: &mut Files) -> Result<(), Failure> {
    let mut page = Vec::new();
    let man = Man::new(command.clone());
    man.render(&mut page).map_err(Failure::work)?;
    pages.push((man.get_filename(), page));
    command
        .get_subcommands()
        .filter(|inner| inner.get_name() != "help")
        .try_for_each(|inner| add_page(inner, pages))
}
