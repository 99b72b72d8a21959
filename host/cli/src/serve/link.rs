//! A symbolic link to a pseudo-terminal, for a name that stays the same from one start to the next.

use crate::output::Failure;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A symbolic link of this program, removed when dropped.
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Makes `path` a link to `target`. A link left by a killed program is replaced.
    pub(super) fn new(path: &Path, target: &str) -> Result<Self, Failure> {
        let shown = path.display();
        let target = PathBuf::from(target);
        match std::fs::read_link(path) {
            Ok(old) if is_left_over(&old, &target) => std::fs::remove_file(path).map_err(|error| {
                Failure::Work(format!("{shown}: the link to {} cannot be replaced: {error}", old.display()))
            })?,
            Ok(old) => {
                let old = old.display();
                let why = format!(
                    "{shown} is a link to {old}, which is in use; give another path, or remove the link"
                );
                return Err(Failure::Input(why));
            }
            Err(error) if error.kind() == ErrorKind::NotFound => (),
            Err(_) => {
                return Err(Failure::Input(format!(
                    "{shown} exists and is not a link to a pseudo-terminal; give another path, or remove the file"
                )));
            }
        }
        std::os::unix::fs::symlink(&target, path)
            .map_err(|error| Failure::Work(format!("{shown}: the link cannot be created: {error}")))?;
        Ok(Self { path: path.to_owned(), target })
    }
}

/// True for a link to a terminal of the same kind that no longer exists, or that is now `target`.
fn is_left_over(old: &Path, target: &Path) -> bool {
    old == target || old.parent() == target.parent() && !old.exists()
}

impl Drop for Link {
    /// Removes the link, unless another program has replaced it.
    fn drop(&mut self) {
        if std::fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            // An error has no consequence at the end of the program.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
