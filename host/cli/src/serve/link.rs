//! A name for a pseudo-terminal that stays the same from one start to the next: a symbolic link.

use crate::output::Failure;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A link of ours, as long as this lives.
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Makes `path` a link to `target`. One that was left there by a program that was killed is replaced.
    pub(super) fn new(path: &Path, target: &str) -> Result<Self, Failure> {
        let shown = path.display();
        let target = PathBuf::from(target);
        match std::fs::read_link(path) {
            Ok(old) if is_left_over(&old, &target) => std::fs::remove_file(path).map_err(|error| {
                Failure::Work(format!("{shown}, a link to {}, cannot be replaced: {error}", old.display()))
            })?,
            Ok(old) => {
                let old = old.display();
                let why = format!("{shown} is a link to {old}, which is in use; name another, or remove it");
                return Err(Failure::Input(why));
            }
            Err(error) if error.kind() == ErrorKind::NotFound => (),
            Err(_) => {
                return Err(Failure::Input(format!(
                    "{shown} exists and is no link to a pseudo-terminal; name another, or remove it"
                )));
            }
        }
        std::os::unix::fs::symlink(&target, path)
            .map_err(|error| Failure::Work(format!("{shown} cannot be made: {error}")))?;
        Ok(Self { path: path.to_owned(), target })
    }
}

/// A link to a terminal of the same kind that is there no more, or is this one by now.
fn is_left_over(old: &Path, target: &Path) -> bool {
    old == target || old.parent() == target.parent() && !old.exists()
}

impl Drop for Link {
    /// Unless somebody else has replaced it.
    fn drop(&mut self) {
        if std::fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            // There is nobody left to be told.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
