//! A symbolic link to a pseudo-terminal. The link keeps its name when the hub is served again on another
//! pseudo-terminal.

use crate::output::Failure;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A symbolic link of this program, removed when dropped.
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Creates the link at `path` to `target`.
    pub(super) fn new(path: &Path, target: &str) -> Result<Self, Failure> {
        std::os::unix::fs::symlink(target, path).map_err(|error| {
            Failure::Work(format!("{}: the link cannot be created: {error}", path.display()))
        })?;
        Ok(Self { path: path.to_owned(), target: target.into() })
    }
}

/// Removes a link at `path` that a killed program has left. `target` is the pseudo-terminal of the next link.
///
/// # Errors
/// There is another file at `path`.
pub(super) fn make_room(path: &Path, target: &str) -> Result<(), Failure> {
    let shown = path.display();
    match std::fs::read_link(path) {
        Ok(old) if is_left_over(&old, Path::new(target)) => std::fs::remove_file(path).map_err(|error| {
            Failure::Work(format!("{shown}: the link to {} cannot be replaced: {error}", old.display()))
        }),
        Ok(old) => {
            let old = old.display();
            let why =
                format!("{shown} is a link to {old}, which is in use; give another path, or remove the link");
            Err(Failure::Input(why))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(_) => Err(Failure::Input(format!(
            "{shown} exists and is not a link to a pseudo-terminal; give another path, or remove the file"
        ))),
    }
}

/// Returns true if the link points to `target`, or to a missing file in the folder of `target`.
fn is_left_over(old: &Path, target: &Path) -> bool {
    old == target || old.parent() == target.parent() && !old.exists()
}

impl Drop for Link {
    /// Removes the link, unless another program has replaced it.
    fn drop(&mut self) {
        if std::fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            // An error is ignored, because the program ends.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
