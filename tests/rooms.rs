//! Checks which modules (rooms) and packages may import which others. Two tables in CONTRIBUTING.md have the rules. The
//! checks search the text of sources, without comments. Of packages they ask cargo.

#[path = "common/repository.rs"]
mod repository;

use repository::{files, read, root};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Each room or package, with the rooms or packages that it may import.
type Rules = BTreeMap<String, BTreeSet<String>>;

const ROOMS: &str = "| room of the library | may import of it |";
const PACKAGES: &str = "| package | may depend on, of these |";

/// Reads the table of CONTRIBUTING.md under a heading. Returns the names between back-ticks of each row, by the names
/// in its first column.
fn table(heading: &str) -> Rules {
    let text = read("CONTRIBUTING.md");
    let mut lines = text.lines().skip_while(|line| *line != heading);
    assert!(lines.next().is_some(), "CONTRIBUTING.md has no table {heading}");
    let rows = lines.skip(1).map_while(|line| line.strip_prefix('|')?.split_once('|'));
    let words = |cell: &str| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    rows.flat_map(|(names, allowed)| {
        let allowed: BTreeSet<String> = words(allowed).into_iter().collect();
        words(names).into_iter().map(move |name| (name, allowed.clone())).collect::<Vec<_>>()
    })
    .collect()
}

/// All Rust sources of a module (`src/hub` is src/hub.rs, or all of the folder src/hub) or folder.
fn sources(module: &str) -> Vec<PathBuf> {
    let file = root().join(format!("{module}.rs"));
    file.exists().then_some(file).into_iter().chain(files(module, "rs")).collect()
}

/// The lines of a source with their numbers, without comments.
fn code(path: &Path) -> Vec<(usize, String)> {
    without_comments(&read(path))
}

/// Removes comments. Joins an import of several lines to one line, with the number of its first line.
fn without_comments(text: &str) -> Vec<(usize, String)> {
    let unfinished = |line: &str| {
        let import = line.trim_start();
        let import = import.starts_with("use ") || import.starts_with("pub") && import.contains(" use ");
        import && !line.contains(';')
    };
    let mut lines: Vec<(usize, String)> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split("//").next().unwrap_or_default();
        match lines.last_mut() {
            Some((_, import)) if unfinished(import) => import.push_str(line.trim()),
            _ => lines.push((number, line.to_owned())),
        }
    }
    lines
}

/// Every line of `modules` in which `wrong` finds something, with what it finds.
fn findings(modules: &[String], wrong: impl Fn(&str, &str, &Path) -> Option<String>) -> Vec<String> {
    let mut found = Vec::new();
    for module in modules {
        for path in sources(module) {
            let shown = path.strip_prefix(root()).unwrap_or(&path);
            for (number, line) in code(&path) {
                if let Some(what) = wrong(module, &line, shown) {
                    found.push(format!("{}:{number}: {what}: {}", shown.display(), line.trim()));
                }
            }
        }
    }
    found
}

fn assert_none(found: &[String]) {
    assert!(found.is_empty(), "against the rules of CONTRIBUTING.md:\n{}", found.join("\n"));
}

/// The first name of every path in `line` that begins with `prefix`, such as `crate::`. For `crate::{a, b::c}` the
/// names are `a` and `b`.
fn first_names<'a>(line: &'a str, prefix: &str) -> Vec<&'a str> {
    let name =
        |text: &'a str| text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
    let starts = line.match_indices(prefix).map(|(at, found)| &line[at + found.len()..]);
    starts
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(group) => {
                let mut depth = 0;
                let parts = group.split(move |c| {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    c == ',' && depth == 0
                });
                parts.map(|part| name(part.trim_start())).collect()
            }
            None => vec![name(rest)],
        })
        .collect()
}

#[test]
fn an_import_is_seen_however_it_is_laid_out() {
    let text = "fn a() {}\npub use crate::{\n    hub::{Hub, motor}, // both\n    board,\n};\nfn b() {}\n";
    let lines = without_comments(text);
    let names: Vec<_> = lines.iter().map(|(number, line)| (*number, first_names(line, "crate::"))).collect();
    assert_eq!(names, [(1, vec![]), (2, vec!["hub", "board", ""]), (6, vec![])]);
}

#[test]
fn every_module_and_package_has_a_rule_and_every_rule_is_of_one() {
    let rooms: BTreeSet<String> = table(ROOMS).into_keys().collect();
    let modules: BTreeSet<String> = code(Path::new("src/lib.rs"))
        .iter()
        .filter_map(|(_, line)| line.trim().strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
        .map(|name| format!("src/{name}"))
        .collect();
    assert_eq!(rooms, modules, "left: rules of CONTRIBUTING.md, right: modules of src/lib.rs");

    let rules: BTreeSet<String> = table(PACKAGES).into_keys().collect();
    let packages: BTreeSet<String> = packages().into_keys().collect();
    assert_eq!(rules, packages, "left: rules of CONTRIBUTING.md, right: members of Cargo.toml");
}

#[test]
fn rooms_of_the_library_import_only_what_they_may() {
    let rules = table(ROOMS);
    let name = |module: &str| module.trim_start_matches("src/").to_owned();
    let rooms: Vec<String> = rules.keys().cloned().collect();
    let all: BTreeSet<String> = rooms.iter().map(|room| name(room)).collect();
    assert_none(&findings(&rooms, |room, line, path| {
        let mut names = first_names(line, "crate::");
        // In the root of a room `super` is the crate.
        if path == Path::new(&format!("{room}.rs")) || path == Path::new(&format!("{room}/mod.rs")) {
            names.extend(first_names(line, "super::"));
        }
        let allowed = |other: &str| other == name(room) || rules[room].contains(other);
        let wrong = names.into_iter().find(|other| all.contains(*other) && !allowed(other))?;
        Some(format!("{room} may not import {wrong}"))
    }));
}

#[test]
fn only_the_tasks_know_of_embassy() {
    let rooms: Vec<String> = table(ROOMS).into_keys().filter(|room| room != "src/tasks").collect();
    assert_none(&findings(&rooms, |room, line, _| {
        let external = ["embassy_", "embedded_io"].into_iter().find(|name| line.contains(name))?;
        Some(format!("{room} may not use {external}.."))
    }));
}

#[test]
fn tests_of_the_library_drive_motors_and_their_physics_on_the_common_bench() {
    let both = |path: &PathBuf| {
        let code: String = code(path).into_iter().map(|(_, line)| line).collect();
        let regulated = code.contains("Hub::new(") || code.contains(" Motor::new(");
        regulated && code.contains("Plant::new(")
    };
    let found: Vec<_> = sources("tests").into_iter().filter(both).collect();
    let allowed = ["tests/common/mod.rs", "tests/rooms.rs"].map(|path| root().join(path));
    let found: Vec<_> = found.iter().filter(|path| !allowed.contains(path)).collect();
    assert!(found.is_empty(), "drive motors on the bench of tests/common: {found:?}");
}

#[test]
fn only_programs_print() {
    // Only host/cli and xtask print to a terminal.
    let libraries =
        ["src", "boards/simulated/src", "boards/emulated/src", "host/client/src", "host/chart/src"];
    let libraries: Vec<String> =
        libraries.into_iter().chain(["host/studies/src"]).map(str::to_owned).collect();
    assert_none(&findings(&libraries, |_, line, _| {
        let prints = ["println!(", "print!(", "dbg!("].into_iter().find(|print| line.contains(print))?;
        Some(format!("a library does not use {prints}..)"))
    }));
}

/// The dependencies of each package of the workspace, as `cargo metadata` reports them, by the folder of the package.
fn packages() -> BTreeMap<String, Vec<Value>> {
    let mut cargo = Command::new(env!("CARGO"));
    let metadata =
        cargo.args(["metadata", "--no-deps", "--offline", "--format-version=1"]).current_dir(root());
    let metadata = metadata.output().expect("cargo runs");
    let metadata: Value = serde_json::from_slice(&metadata.stdout).expect("the packages of the workspace");
    let each = |package: &Value| {
        let manifest = package["manifest_path"].as_str()?.trim_end_matches("/Cargo.toml");
        Some((folder(manifest), package["dependencies"].as_array()?.clone()))
    };
    metadata["packages"].as_array().into_iter().flatten().filter_map(each).collect()
}

/// Folder of a package in the repository. The folder of the library is `src`.
fn folder(path: &str) -> String {
    let folder =
        Path::new(path).strip_prefix(root()).expect("a package of the workspace").display().to_string();
    if folder.is_empty() { "src".to_owned() } else { folder }
}

/// True for a dependency of the tests only.
fn is_dev(dependency: &Value) -> bool {
    dependency["kind"] == "dev"
}

/// Returns the level of a package's wing, from the inside out: src, boards, host, and then tools.
fn wing(package: &str) -> usize {
    ["src", "boards", "host"].iter().position(|wing| package.starts_with(wing)).unwrap_or(3)
}

#[test]
fn packages_depend_only_on_what_they_may_and_no_wing_on_one_outside_it() {
    let rules = table(PACKAGES);
    for (package, dependencies) in packages() {
        for dependency in dependencies {
            let Some(other) = dependency["path"].as_str().map(folder) else { continue };
            // The tests of the library use the library with more of its features.
            if other == package {
                continue;
            }
            assert!(wing(&other) <= wing(&package), "{package} is further inside than {other}");
            assert!(
                is_dev(&dependency) || rules[&package].contains(&other),
                "{package} may not depend on {other}"
            );
        }
    }
}

#[test]
fn crates_of_others_stay_in_the_rooms_that_are_for_them() {
    for (package, dependencies) in packages() {
        assert!(
            package != "xtask" || dependencies.is_empty(),
            "xtask needs nothing, so that it is built at once"
        );
        for dependency in dependencies {
            let name = dependency["name"].as_str().expect("a name");
            assert!(package == "host/cli" || name != "clap", "{package}: only host/cli reads options");
            let embassy = name.starts_with("embassy-") && !is_dev(&dependency);
            assert!(!embassy || wing(&package) < 2, "{package}: packages of the host do not use embassy");
        }
    }
}

#[test]
fn the_client_builds_without_the_tasks() {
    let client = &packages()["host/client"];
    let core = client.iter().find(|one| one["name"] == "motor-hub" && !is_dev(one)).expect("the library");
    let features = core["features"].as_array().expect("a list");
    assert_eq!(core["uses_default_features"], false, "{core}");
    assert!(!features.contains(&"tasks".into()), "{core}");
}
