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

/// The text of a source without comments. It has the same lines.
fn code(path: &Path) -> String {
    without_comments(&read(path))
}

fn without_comments(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Asserts that `wrong` finds nothing in the sources of `modules`. It gets a module, the code and the path of a source. It
/// returns what is wrong, with the place in the code.
fn assert_nothing(modules: &[String], wrong: impl Fn(&str, &str, &Path) -> Vec<(usize, String)>) {
    let mut found = Vec::new();
    for (module, path) in
        modules.iter().flat_map(|module| sources(module).into_iter().map(move |path| (module, path)))
    {
        let (code, shown) = (code(&path), path.strip_prefix(root()).unwrap_or(&path));
        for (at, what) in wrong(module, &code, shown) {
            let line = 1 + code[..at].matches('\n').count();
            found.push(format!("{}:{line}: {what}", shown.display()));
        }
    }
    assert!(found.is_empty(), "against the rules of CONTRIBUTING.md:\n{}", found.join("\n"));
}

/// Asserts that no source of `modules` contains one of these words.
fn assert_without(words: &[&str], modules: &[String]) {
    assert_nothing(modules, |module, code, _| {
        let places = words.iter().flat_map(|word| code.match_indices(word));
        places.map(|(at, word)| (at, format!("{module} may not use {word}.."))).collect()
    });
}

/// The first name of every path in `code` that begins with `prefix`, such as `crate::`, with the place of the path. For
/// `crate::{a, b::c}` the names are `a` and `b`.
fn first_names<'a>(code: &'a str, prefix: &str) -> Vec<(usize, &'a str)> {
    let name = |text: &'a str| {
        text.trim_start().split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default()
    };
    let mut names = Vec::new();
    for (at, _) in code.match_indices(prefix) {
        let path = code[at + prefix.len()..].split(';').next().unwrap_or_default();
        let mut depth = 0;
        let parts = path.trim_start_matches('{').split(|c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        });
        let count = if path.starts_with('{') { usize::MAX } else { 1 };
        names.extend(parts.take(count).map(|part| (at, name(part))));
    }
    names
}

#[test]
fn an_import_is_seen_however_it_is_laid_out() {
    let code = without_comments(
        "fn a() {}\npub use crate::{\n    hub::{Hub, motor}, // both\n    board,\n};\nfn b() { crate::c(d, e) }\n",
    );
    let names: Vec<_> = first_names(&code, "crate::").into_iter().map(|(_, name)| name).collect();
    assert_eq!(names, ["hub", "board", "", "c"]);
}

#[test]
fn every_module_and_package_has_a_rule_and_every_rule_is_of_one() {
    let rooms: BTreeSet<String> = table(ROOMS).into_keys().collect();
    let modules: BTreeSet<String> = code(Path::new("src/lib.rs"))
        .lines()
        .filter_map(|line| line.trim().strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
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
    assert_nothing(&rooms, |room, code, path| {
        let mut names = first_names(code, "crate::");
        // In the root of a room `super` is the crate.
        if path == Path::new(&format!("{room}.rs")) || path == Path::new(&format!("{room}/mod.rs")) {
            names.extend(first_names(code, "super::"));
        }
        names.retain(|(_, other)| {
            all.contains(*other) && *other != name(room) && !rules[room].contains(*other)
        });
        names.into_iter().map(|(at, other)| (at, format!("{room} may not import {other}"))).collect()
    });
}

#[test]
fn only_the_tasks_know_of_embassy() {
    let rooms: Vec<String> = table(ROOMS).into_keys().filter(|room| room != "src/tasks").collect();
    assert_without(&["embassy_", "embedded_io"], &rooms);
}

#[test]
fn tests_of_the_library_drive_motors_and_their_physics_on_the_common_bench() {
    let both = |path: &PathBuf| {
        let code = code(path);
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
    let libraries = [
        "src",
        "boards/simulated/src",
        "boards/emulated/src",
        "host/client/src",
        "host/chart/src",
        "host/studies/src",
    ];
    assert_without(&["println!(", "print!(", "dbg!("], &libraries.map(str::to_owned));
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
