//! Notes about the hubs served on this machine. `serve` writes the notes, and `client scan` reads them to find the
//! hubs.
//!
//! A note is a file in a folder that only its user can access. It has one line: whether the hub has a host, and its
//! place. The serving program keeps the file locked. A note that another program can lock is a leftover of a killed
//! program. Notes exist on Unix only.

/// A served hub.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct ServedHub {
    /// Place that hosts open: HOST:PORT or a path.
    pub(crate) place: String,
    /// True if a host uses the hub.
    pub(crate) has_host: bool,
}

#[cfg(not(unix))]
pub(crate) fn all() -> std::io::Result<Vec<ServedHub>> {
    Ok(Vec::new())
}

#[cfg(unix)]
pub(crate) use unix::{ServedHubFile, all};

#[cfg(unix)]
mod unix {
    use super::ServedHub;
    use std::fs::{self, DirBuilder, File, TryLockError};
    use std::io::{self, ErrorKind};
    use std::os::unix::fs::{DirBuilderExt, FileExt, MetadataExt};
    use std::path::{Path, PathBuf};
    use std::time::Duration;

    /// Word of a note whose hub has no host. It has as many bytes as [`TAKEN`], so one write of these bytes changes the
    /// note.
    const FREE: &str = "free ";
    /// Word of a note whose hub has a host.
    const TAKEN: &str = "taken";

    /// Extension of a note that is not complete.
    const UNLOCKED: &str = "new";
    /// Age from which a note that is not complete counts as a leftover. A program completes its note within
    /// milliseconds.
    const INCOMPLETE: Duration = Duration::from_secs(60);

    /// A note of this program, removed when dropped.
    pub(crate) struct ServedHubFile {
        path: PathBuf,
        file: File,
        has_host: bool,
    }

    impl ServedHubFile {
        /// Leaves a note of a hub at `place` that has no host.
        pub(crate) fn create(place: &str) -> io::Result<Self> {
            Self::create_in(&folder(), place)
        }

        pub(super) fn create_in(folder: &Path, place: &str) -> io::Result<Self> {
            match DirBuilder::new().mode(0o700).create(folder) {
                Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error),
                _ => check(folder)?,
            }
            let path = folder.join(std::process::id().to_string());
            // The file has another name until it is locked, so that no scan removes it as a leftover.
            let unlocked = path.with_extension(UNLOCKED);
            let file = File::create(&unlocked)?;
            file.try_lock()?;
            file.write_all_at(format!("{FREE} {place}\n").as_bytes(), 0)?;
            fs::rename(&unlocked, &path)?;
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
    fn folder() -> PathBuf {
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

    /// Returns the hubs that are served at present, and removes leftover notes.
    pub(crate) fn all() -> io::Result<Vec<ServedHub>> {
        all_in(&folder())
    }

    pub(super) fn all_in(folder: &Path) -> io::Result<Vec<ServedHub>> {
        match check(folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
            checked => checked?,
        }
        let mut served = Vec::new();
        for note in fs::read_dir(folder)? {
            let path = note?.path();
            if path.extension().is_none() {
                served.extend(read(&path)?);
            } else if path.extension().is_some_and(|extension| extension == UNLOCKED) && is_old(&path) {
                let _ = fs::remove_file(&path);
            }
        }
        served.sort_by(|a, b| a.place.cmp(&b.place));
        Ok(served)
    }

    /// True if a file is older than [`INCOMPLETE`].
    fn is_old(path: &Path) -> bool {
        let age = fs::metadata(path).and_then(|data| data.modified()).map(|written| written.elapsed());
        matches!(age, Ok(Ok(age)) if age > INCOMPLETE)
    }

    /// Reads a note; `None` if it is a leftover.
    fn read(path: &Path) -> io::Result<Option<ServedHub>> {
        let file = match File::open(path) {
            // The serving program has ended and removed its note.
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            file => file?,
        };
        // The lock is shared, so that two scans at the same time do not take each other for the serving program.
        match file.try_lock_shared() {
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
}

#[cfg(all(test, unix))]
mod tests {
    use super::unix::{ServedHubFile, all_in};
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::time::{Duration, SystemTime};

    fn folder(test: &str) -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("motor-hub-test-{test}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        folder
    }

    #[test]
    fn an_incomplete_note_is_removed_once_it_is_a_minute_old() {
        let folder = folder("incomplete");
        drop(ServedHubFile::create_in(&folder, "here").unwrap());
        let incomplete = fs::File::create(folder.join("1.new")).unwrap();
        assert_eq!(all_in(&folder).unwrap(), []);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "its program may still complete it");
        incomplete.set_modified(SystemTime::now() - Duration::from_secs(61)).unwrap();
        assert_eq!(all_in(&folder).unwrap(), []);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
        fs::remove_dir(&folder).unwrap();
    }

    #[test]
    fn notes_are_in_a_folder_that_is_the_users_alone_or_nowhere() {
        let folder = folder("folder");
        drop(ServedHubFile::create_in(&folder, "127.0.0.1:7070").unwrap());
        assert_eq!(fs::metadata(&folder).unwrap().permissions().mode() & 0o777, 0o700);
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o770)).unwrap();
        for refused in [ServedHubFile::create_in(&folder, "here").map(drop), all_in(&folder).map(drop)] {
            assert!(refused.unwrap_err().to_string().contains("a folder that only this user can access"));
        }
        fs::remove_dir_all(&folder).unwrap();
        let elsewhere = folder.with_extension("link");
        let _ = fs::remove_file(&elsewhere);
        std::os::unix::fs::symlink(std::env::temp_dir(), &elsewhere).unwrap();
        assert!(ServedHubFile::create_in(&elsewhere, "here").is_err());
        fs::remove_file(&elsewhere).unwrap();
    }
}
