//! The files of the page: the server has all of them, the page loads nothing from other servers, and uPlot is unmodified.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

use dashboard::assets;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::Path;

/// Checksum of uPlot 1.6.32 as published.
const UPLOT: [(&str, &str); 2] = [
    ("/vendor/uPlot.iife.min.js", "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f"),
    ("/vendor/uPlot.min.css", "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04"),
];

#[test]
fn the_plots_are_those_of_uplot_1_6_32() {
    for (path, expected) in UPLOT {
        let digest = Sha256::digest(assets::find(path).unwrap().bytes);
        let hex: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, expected, "{path}");
    }
}

#[test]
fn every_file_of_the_page_is_served_and_its_licence_lies_beside_it() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("page");
    let mut files = BTreeSet::new();
    let mut folders = vec![folder.clone()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap().flatten() {
            if entry.path().is_dir() {
                folders.push(entry.path());
            } else {
                let path = entry.path();
                files
                    .insert(format!("/{}", path.strip_prefix(&folder).unwrap().display()).replace('\\', "/"));
            }
        }
    }
    assert!(files.remove("/vendor/LICENSE"), "the licence of uPlot");
    assert!(files.remove("/index.html"), "the page itself, which only a token opens");
    let served: BTreeSet<String> = assets::ALL.iter().map(|asset| asset.path.to_owned()).collect();
    assert_eq!(served, files);
}

#[test]
fn no_file_names_another_place() {
    let own = assets::ALL.iter().filter(|asset| !asset.path.starts_with("/vendor/"));
    let own = own.map(|asset| (asset.path, std::str::from_utf8(asset.bytes).unwrap()));
    for (path, text) in own.chain([("/", assets::PAGE)]) {
        let text = text.replace("http://www.w3.org/", "");
        for wrong in ["http://", "https://", "//cdn", "@import", "eval(", "document.write"] {
            assert!(!text.contains(wrong), "{path}: {wrong}");
        }
    }
}
