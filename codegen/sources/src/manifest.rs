//! The robots of a workspace whose whole source is checked in, and the digests of the others.
//!
//! `sources.txt`, next to the directory of modules, names the robots whose source is checked in, one
//! per line. `digests.txt`, in the same place, is written by regen and contains a digest of the
//! source of every other robot. Without `sources.txt` every robot's source is checked in.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::error::SourceError;
use crate::module::Module;

const SOURCES: &str = "sources.txt";
const DIGESTS: &str = "digests.txt";
const HEAD: &str = "\
# Written by regen generate: modules that are not checked in. Per robot the lines of its module and
# their SHA-256, and the operations of each function.
";

/// The robots whose whole source is written into a directory.
#[derive(Debug)]
pub(crate) struct Manifest {
    file: PathBuf,
    names: BTreeSet<String>,
}

impl Manifest {
    /// Reads the manifest of a directory of modules; `None` if there is none, so that every source
    /// is written.
    pub(crate) fn of(dir: &Path) -> Result<Option<Self>, SourceError> {
        let file = sibling(dir, SOURCES);
        let text = match fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(SourceError::io("read", &file, error)),
        };
        let lines = text.lines().map(str::trim);
        let names = lines
            .filter(|line| !line.is_empty() && !line.starts_with('#'))
            .map(str::to_owned)
            .collect();
        Ok(Some(Self { file, names }))
    }

    /// Returns an error unless every name of the manifest is one of these robots.
    pub(crate) fn names_only(&self, robots: &BTreeMap<String, Module>) -> Result<(), SourceError> {
        match self.names.iter().find(|name| !robots.contains_key(*name)) {
            None => Ok(()),
            Some(name) => Err(SourceError::UnknownRobot {
                file: self.file.clone(),
                robot: name.clone(),
            }),
        }
    }

    /// Removes the robots that the manifest does not name, and returns their digests by name.
    pub(crate) fn take_others(
        &self,
        robots: &mut BTreeMap<String, Module>,
    ) -> BTreeMap<String, String> {
        robots
            .extract_if(.., |name, _| !self.names.contains(name))
            .map(|(name, module)| (name, module.digest))
            .collect()
    }

    /// The path of the file of digests.
    pub(crate) fn digests(&self) -> PathBuf {
        self.file.with_file_name(DIGESTS)
    }
}

/// The path of the file that contains a robot's source, or its digest if `sources.txt` next to the
/// directory does not name the robot.
///
/// # Errors
///
/// When `sources.txt` exists and cannot be read.
pub fn place(dir: &Path, robot: &str) -> Result<PathBuf, SourceError> {
    Ok(match Manifest::of(dir)? {
        Some(manifest) if !manifest.names.contains(robot) => manifest.digests(),
        _ => dir.join(format!("{robot}.rs")),
    })
}

/// The text of a file of digests: the entries of `found`, with `new` added or replacing entries of
/// the same robots.
pub(crate) fn digests(found: Option<&str>, new: BTreeMap<String, String>) -> String {
    let mut all = BTreeMap::new();
    let mut robot = None;
    for line in found.unwrap_or_default().split_inclusive('\n') {
        match line.split_once(": ") {
            _ if line.starts_with('#') => robot = None,
            Some((name, _)) if !line.starts_with(' ') => robot = Some(name.to_owned()),
            _ => {}
        }
        if let Some(name) = &robot {
            all.entry(name.clone())
                .or_insert_with(String::new)
                .push_str(line);
        }
    }
    all.extend(new);
    all.values().fold(HEAD.to_owned(), |text, one| text + one)
}

fn sibling(dir: &Path, name: &str) -> PathBuf {
    match dir.parent() {
        // the parent of the relative path `src` is the current directory
        Some(parent) if dir.file_name().is_some() => parent.join(name),
        _ => dir.join("..").join(name),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_takes_the_place_of_the_one_of_the_same_robot_only() {
        let old = "# head: of a file\nb: 1\n    f: 1\n    g: 2\nc: 1\n    f: 1\n";
        let new = |list: &[(&str, &str)]| {
            let own = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
            list.iter().map(own).collect::<BTreeMap<_, _>>()
        };
        assert_eq!(
            digests(
                Some(old),
                new(&[("b", "b: 2\n    f: 3\n"), ("a", "a: 1\n")])
            ),
            format!("{HEAD}a: 1\nb: 2\n    f: 3\nc: 1\n    f: 1\n")
        );
        assert_eq!(digests(None, new(&[])), HEAD);
    }

    #[test]
    fn a_file_beside_a_folder_is_named_without_a_way_through_it() {
        assert_eq!(sibling(Path::new("a/src"), "b"), Path::new("a/b"));
        assert_eq!(sibling(Path::new("src"), "b"), Path::new("b"));
        assert_eq!(sibling(Path::new(".."), "b"), Path::new("../../b"));
    }
}
