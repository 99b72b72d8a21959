//! `cargo xtask dist`: the files that a release carries, in `target/dist`.

use crate::board;
use crate::python;
use crate::tool::{Failed, cargo_command, command, output, root, run, target_folder};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// Targets that the program is built for. It is linked statically, so that it runs on every Linux.
const COMPUTERS: [&str; 2] = ["x86_64-unknown-linux-musl", "aarch64-unknown-linux-musl"];

/// Beginnings of the names of licence files, in capital letters.
const LICENCE_FILES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "UNLICENSE", "NOTICE"];

/// With `--programs` the task only builds the programs, which takes most of its time.
pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    match arguments {
        [] => (),
        [only] if only == "--programs" => return programs(),
        _ => {
            let given = arguments.join(" ");
            return Err(Failed(format!("this task takes --programs or no argument; given: {given}")));
        }
    }
    let dist = root().join("target/dist");
    if dist.exists() {
        fs::remove_dir_all(&dist).map_err(|error| Failed::at(&dist, error))?;
    }
    fs::create_dir_all(&dist).map_err(|error| Failed::at(&dist, error))?;
    programs()?;
    for computer in COMPUTERS {
        let program = target_folder().join(computer).join("shipped/motor-hub");
        copy(&program, &dist.join(format!("motor-hub-{computer}")))?;
    }
    for board in board::ALL {
        let elf = board.build()?;
        copy(&elf, &dist.join(format!("{}.elf", file_name(board.name))))?;
        let bin = board.raw(&elf)?;
        copy(&bin, &dist.join(format!("{}.bin", file_name(board.name))))?;
    }
    python::wheel(&dist)?;
    for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
        copy(&root().join(licence), &dist.join(licence))?;
    }
    let licences = dist.join("THIRD-PARTY.md");
    fs::write(&licences, third_party()?).map_err(|error| Failed::at(&licences, error))?;
    let sums = checksums(&dist)?;
    let file = dist.join("SHA256SUMS");
    fs::write(&file, &sums).map_err(|error| Failed::at(&file, error))?;
    print!("{sums}");
    Ok(())
}

/// Returns the name of a board's image among the files of a release.
fn file_name(board: &str) -> String {
    if board.starts_with("boot-") { board.to_owned() } else { format!("motor-hub-{board}") }
}

fn copy(from: &Path, to: &Path) -> Result<(), Failed> {
    fs::copy(from, to).map(drop).map_err(|error| Failed::at(from, error))
}

/// Builds the program for all targets, with the linker of the toolchain. One command builds for all, so that a crate of one target is
/// compiled while another target waits for its crates.
fn programs() -> Result<(), Failed> {
    run(command("rustup").args(["target", "add"]).args(COMPUTERS))?;
    let mut build = cargo_command(&["build", "--package", "motor-hub-cli", "--profile", "shipped"]);
    for computer in COMPUTERS {
        let linker = format!("target.{computer}.linker=\"rust-lld\"");
        build.args(["--target", computer, "--config", &linker]);
    }
    run(&mut build)
}

/// Returns the checksums of all files in a folder, as `sha256sum --check` reads them.
fn checksums(folder: &Path) -> Result<String, Failed> {
    let entries = fs::read_dir(folder).map_err(|error| Failed::at(folder, error))?;
    let mut names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
    names.sort();
    output(command("sha256sum").args(names).current_dir(folder))
}

/// Returns a document of all third-party packages in the program, the wheel and the images, each with its licence.
fn third_party() -> Result<String, Failed> {
    let mut packages = tree(&["--package", "motor-hub-cli", "--package", "motor-hub-python"])?;
    for board in board::ALL {
        packages.extend(tree(&["--package", board.name, "--target", board::TARGET])?);
    }
    let mut text = String::from(
        "# Licences of the packages that this release is made of\n\n\
         The page of the dashboard also carries uPlot 1.6.32, MIT, <https://github.com/leeoniya/uPlot>.\n",
    );
    for (name, version, licence) in packages {
        // Writing to a string does not fail.
        let _ = writeln!(text, "\n## {name} {version}\n\n{licence}");
        for file in licence_files(&name, &version)? {
            let licence = fs::read_to_string(&file).map_err(|error| Failed::at(&file, error))?;
            let _ = writeln!(text, "\n```text\n{}\n```", licence.trim_end().replace("```", "'''"));
        }
    }
    Ok(text)
}

/// Returns name, version and licence of each package that the packages in `of` depend on, without those of this workspace.
fn tree(of: &[&str]) -> Result<BTreeSet<(String, String, String)>, Failed> {
    let format = ["tree", "--edges", "normal", "--prefix", "none", "--format", "{p}|{l}"];
    let text = output(cargo_command(&[&format[..], of].concat()).env("CARGO_TERM_COLOR", "never"))?;
    let packages = text.lines().filter_map(|line| {
        let (package, licence) = line.trim_end_matches(" (*)").split_once('|')?;
        let mut words = package.split_whitespace();
        let (name, version) = (words.next()?, words.next()?.strip_prefix('v')?);
        // A package of this workspace has its path in brackets. Other brackets hold "(proc-macro)".
        let own = words.any(|word| word.starts_with("(/"));
        (!own).then(|| (name.to_owned(), version.to_owned(), licence.to_owned()))
    });
    Ok(packages.collect())
}

/// Returns the licence files in the unpacked sources of a package.
fn licence_files(name: &str, version: &str) -> Result<Vec<PathBuf>, Failed> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(std::env::home_dir()?.join(".cargo")));
    let sources = home.ok_or_else(|| Failed("neither CARGO_HOME nor a home folder".to_owned()))?;
    let sources = sources.join("registry/src");
    let registries = fs::read_dir(&sources).map_err(|error| Failed::at(&sources, error))?;
    let folders = registries.flatten().map(|registry| registry.path().join(format!("{name}-{version}")));
    let is_licence = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_uppercase();
        path.is_file() && LICENCE_FILES.iter().any(|start| name.starts_with(start))
    };
    let files = folders.filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let mut files: Vec<PathBuf> = files.map(|entry| entry.path()).filter(is_licence).collect();
    files.sort();
    Ok(files)
}
