//! The directories of robot specs and their generated source.

use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::error::SourceError;

/// A directory with `robots/` and `generated/src/`.
#[derive(Debug)]
pub struct Workspace {
    root: PathBuf,
}

impl Workspace {
    /// The nearest workspace from `start` upward.
    pub fn above(start: &Path) -> Option<Self> {
        let start = start.canonicalize().ok()?;
        start
            .ancestors()
            .find(|dir| dir.join("robots").is_dir() && dir.join("generated/src").is_dir())
            .map(|dir| Self {
                root: dir.to_owned(),
            })
    }

    /// The workspace of the current directory.
    ///
    /// # Errors
    ///
    /// [`SourceError::NoWorkspace`].
    pub fn current() -> Result<Self, SourceError> {
        Self::above(Path::new(".")).ok_or(SourceError::NoWorkspace)
    }

    /// The default directory of generated modules.
    pub fn generated(&self) -> PathBuf {
        shortened(&self.root.join("generated/src"))
    }

    /// Whether the file is one of the workspace's `robots/*.yaml`.
    pub fn contains_robot(&self, file: &Path) -> bool {
        let dir = self.root.join("robots").canonicalize();
        let file = file.canonicalize();
        dir.is_ok_and(|dir| file.is_ok_and(|file| file.parent() == Some(&dir)))
    }

    /// Every `robots/*.yaml`, sorted.
    ///
    /// # Errors
    ///
    /// If the directory cannot be read or contains no spec.
    pub fn robots(&self) -> Result<Vec<PathBuf>, SourceError> {
        let dir = shortened(&self.root.join("robots"));
        let mut found = entries(&dir).map_err(|error| SourceError::io("read", &dir, error))?;
        found.retain(|path| path.extension().is_some_and(|e| e == "yaml") && path.is_file());
        if found.is_empty() {
            return Err(SourceError::NoRobots(dir));
        }
        Ok(found)
    }
}

/// The paths in a directory, sorted.
///
/// # Errors
///
/// If the directory cannot be read.
pub fn entries(dir: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = fs::read_dir(dir)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<io::Result<Vec<_>>>()?;
    found.sort();
    Ok(found)
}

/// The path relative to the current directory, where it lies below it; else the path itself.
fn shortened(path: &Path) -> PathBuf {
    env::current_dir()
        .and_then(|dir| dir.canonicalize())
        .ok()
        .and_then(|dir| path.strip_prefix(dir).ok().map(Path::to_owned))
        .map_or_else(
            || path.to_owned(),
            |path| {
                if path.as_os_str().is_empty() {
                    ".".into()
                } else {
                    path
                }
            },
        )
}

/// The generated-source directory of the workspace that contains the file, or else the current
/// directory.
pub fn generated_beside(file: &Path) -> PathBuf {
    let beside = match file.parent() {
        Some(dir) if !dir.as_os_str().is_empty() => dir,
        _ => Path::new("."),
    };
    Workspace::above(beside).map_or_else(|| PathBuf::from("."), |w| w.generated())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn a_file_is_generated_into_the_workspace_that_it_is_in_and_not_into_the_one_around() {
        let root = env::temp_dir().join(format!("regen-workspace-{}", std::process::id()));
        let generated = root.join("generated/src");
        fs::create_dir_all(root.join("robots/more")).unwrap();
        fs::create_dir_all(&generated).unwrap();
        let found = ["robots/a.yaml", "robots/more/b.yaml", "c.yaml"]
            .map(|file| generated_beside(&root.join(file)));
        let wanted = generated.canonicalize().unwrap();
        fs::remove_dir_all(&root).unwrap();
        assert_eq!(found, [(); 3].map(|()| wanted.clone()));
        // a file without a folder is in the current one
        assert_eq!(
            generated_beside(Path::new("d.yaml")),
            generated_beside(Path::new("./d.yaml"))
        );
    }
}
