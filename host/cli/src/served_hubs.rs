//! Notes about the hubs served on this machine. `serve` writes the notes, and `client scan` reads them to find the
//! hubs.
//!
//! A note is a file in a folder that only its user can access. It has one line: whether the hub has a host, and its
//! place. The serving program keeps the file locked. A note that another program can lock is a leftover of a killed
//! program. While a program makes its note, a lock on the folder keeps scans away. Notes exist on Unix only.

use std::fs::{self, DirBuilder, File, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Word of a note whose hub has no host. It has as many bytes as [`TAKEN`], so one write of these bytes changes the
/// note.
const FREE: &str = "free ";
/// Word of a note whose hub has a host.
const TAKEN: &str = "taken";

/// A served hub.
pub(crate) struct ServedHub {
    /// Place that hosts open: HOST:PORT or a path.
    pub(crate) place: String,
    /// True if a host uses the hub.
    pub(crate) has_host: bool,
}

/// A note of this program, removed when dropped.
pub(crate) struct ServedHubFile {
    path: PathBuf,
    file: File,
    has_host: bool,
}

impl ServedHubFile {
    /// Leaves a note in a folder, of a hub at `place` that has no host.
    pub(crate) fn create(folder: &Path, place: &str) -> io::Result<Self> {
        match DirBuilder::new().mode(0o700).create(folder) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error),
            _ => check(folder)?,
        }
        let unscanned = File::open(folder)?;
        unscanned.lock_shared()?;
        let path = folder.join(std::process::id().to_string());
        let file = File::create(&path)?;
        file.try_lock()?;
        file.write_all_at(format!("{FREE} {place}\n").as_bytes(), 0)?;
        Ok(Self { path, file, has_host: false })
    }

    /// Writes whether the hub has a host.
    pub(crate) fn set_has_host(&mut self, has_host: bool) {
        if has_host != self.has_host {
            self.has_host = has_host;
            // If the write fails, a scan connects to the hub and finds that the hub has a host.
            let _ = self.file.write_all_at(if has_host { TAKEN } else { FREE }.as_bytes(), 0);
        }
    }
}

impl Drop for ServedHubFile {
    fn drop(&mut self) {
        // A file that cannot be removed stays unlocked, and counts as a leftover.
        let _ = fs::remove_file(&self.path);
    }
}

/// The user's folder for notes.
pub(crate) fn folder() -> PathBuf {
    let of_session = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    match of_session.filter(|folder| folder.is_absolute() && folder.is_dir()) {
        Some(folder) => folder.join("motor-hub"),
        None => std::env::temp_dir().join(format!("motor-hub-{}", rustix::process::getuid().as_raw())),
    }
}

/// Checks that only this user can access the folder. A note of another user could lead hosts to any address.
fn check(folder: &Path) -> io::Result<()> {
    let found = fs::symlink_metadata(folder)?;
    let is_ours = found.uid() == rustix::process::getuid().as_raw();
    if found.is_dir() && is_ours && found.mode() & 0o077 == 0 {
        return Ok(());
    }
    let why = format!("{} must be a folder that only this user can access (mode 700)", folder.display());
    Err(io::Error::new(ErrorKind::PermissionDenied, why))
}

/// Returns the hubs of the notes in a folder that are served at present, and removes leftover notes.
pub(crate) fn all(folder: &Path) -> io::Result<Vec<ServedHub>> {
    match check(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        checked => checked?,
    }
    let scanned = File::open(folder)?;
    scanned.lock()?;
    let mut served = Vec::new();
    for note in fs::read_dir(folder)? {
        served.extend(read(&note?.path())?);
    }
    served.sort_by(|a, b| a.place.cmp(&b.place));
    Ok(served)
}

/// Reads a note; `None` if it is a leftover, which is removed.
fn read(path: &Path) -> io::Result<Option<ServedHub>> {
    let file = match File::open(path) {
        // The serving program has ended and removed its note.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        file => file?,
    };
    match file.try_lock() {
        Ok(()) => {
            let _ = fs::remove_file(path);
            return Ok(None);
        }
        Err(TryLockError::WouldBlock) => (),
        Err(TryLockError::Error(error)) => return Err(error),
    }
    let text = io::read_to_string(file)?;
    let says = |word: &str, has_host| {
        text.strip_prefix(word).map(|place| ServedHub { place: place.trim().to_owned(), has_host })
    };
    Ok(says(FREE, false).or_else(|| says(TAKEN, true)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn notes_are_in_a_folder_that_is_the_users_alone_or_nowhere() {
        let folder = std::env::temp_dir().join(format!("motor-hub-test-folder-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        drop(ServedHubFile::create(&folder, "127.0.0.1:7070").unwrap());
        assert_eq!(fs::metadata(&folder).unwrap().permissions().mode() & 0o777, 0o700);
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o770)).unwrap();
        for refused in [ServedHubFile::create(&folder, "here").map(drop), all(&folder).map(drop)] {
            assert!(refused.unwrap_err().to_string().contains("a folder that only this user can access"));
        }
        fs::remove_dir_all(&folder).unwrap();
        let elsewhere = folder.with_extension("link");
        let _ = fs::remove_file(&elsewhere);
        std::os::unix::fs::symlink(std::env::temp_dir(), &elsewhere).unwrap();
        assert!(ServedHubFile::create(&elsewhere, "here").is_err());
        fs::remove_file(&elsewhere).unwrap();
    }
}
