//! Texts that are compared with files beside the tests.

use std::path::Path;

/// Compares each text, byte by byte, with the file of its name in `tests/snapshots`, which must contain exactly these
/// files. With `UPDATE_SNAPSHOTS=1` in the environment it writes the files instead.
pub(crate) fn assert_all(snapshots: &[(String, String)]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some_and(|value| value == "1") {
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder can be made");
        for (name, text) in snapshots {
            std::fs::write(folder.join(name), text).expect("a file can be written");
        }
        return;
    }
    let mut wrong: Vec<String> = Vec::new();
    for (name, text) in snapshots {
        match std::fs::read_to_string(folder.join(name)) {
            Ok(stored) if stored == *text => {}
            Ok(stored) => wrong.push(format!("{name}: {}", first_difference(&stored, text))),
            Err(error) => wrong.push(format!("{name}: {error}")),
        }
    }
    for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if snapshots.iter().all(|snapshot| snapshot.0 != name) {
            wrong.push(format!("{name}: nothing draws it any more"));
        }
    }
    assert!(
        wrong.is_empty(),
        "not as in {}:\n{}\nIf that is meant, run: UPDATE_SNAPSHOTS=1 cargo test -p {}",
        folder.display(),
        wrong.join("\n"),
        env!("CARGO_PKG_NAME")
    );
}

fn first_difference(stored: &str, text: &str) -> String {
    let number = stored.lines().zip(text.lines()).take_while(|(a, b)| a == b).count();
    // A line of an SVG can be very long.
    let short =
        |text: &str| text.lines().nth(number).unwrap_or("(end)").chars().take(160).collect::<String>();
    format!("line {}\n  stored: {}\n  now:    {}", number + 1, short(stored), short(text))
}
