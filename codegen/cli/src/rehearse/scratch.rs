//! The folder of the simulated logs.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use crate::exit::Failure;
use crate::interrupt;

/// The largest number of names tried for a temporary folder.
const MAX_TRIES: u32 = 1000;

/// The folder of the logs, which is removed at the end unless the user named it.
pub(super) struct Folder {
    path: PathBuf,
    is_own: bool,
}

impl Folder {
    /// The given folder, created where it is missing, or else a new temporary one.
    pub(super) fn new(given: Option<&Path>) -> Result<Self, Failure> {
        if let Some(path) = given {
            fs::create_dir_all(path).map_err(|why| Failure::io("create", path, &why))?;
            return Ok(Self {
                path: path.to_owned(),
                is_own: false,
            });
        }
        let mut number = 0;
        loop {
            let name = format!("regen-rehearse-{}-{number}", std::process::id());
            let path = std::env::temp_dir().join(name);
            match interrupt::creating(&path, || fs::create_dir(&path)) {
                Ok(()) => return Ok(Self { path, is_own: true }),
                Err(why) if why.kind() == ErrorKind::AlreadyExists && number < MAX_TRIES => {
                    number += 1;
                }
                Err(why) => return Err(Failure::io("create", &path, &why)),
            }
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.is_own {
            // a folder that cannot be removed is left for the system to clean up
            let _ = fs::remove_dir_all(&self.path);
            interrupt::finish(&self.path);
        }
    }
}
