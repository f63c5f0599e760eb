//! Searches for the file of a spec.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// The path of a spec's file.
pub(crate) struct LocatedSpec {
    /// The path in error messages, relative to the compiler's working directory where possible.
    pub(crate) shown: String,
    /// The absolute path for `include_bytes!`.
    pub(crate) absolute: PathBuf,
}

/// Searches for a spec; the error lists the places that were searched.
///
/// `source` is the file in which the macro is called, if known.
pub(crate) fn locate(file: &str, source: Option<&Path>) -> Result<LocatedSpec, String> {
    let manifest = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let mut tried: Vec<(PathBuf, String)> = Vec::new();
    if let Some(dir) = source.and_then(Path::parent) {
        tried.push((dir.join(file), "beside this file".to_owned()));
    }
    if let Some(dir) = &manifest {
        tried.push((dir.join(file), "in the crate's directory".to_owned()));
        let robots = dir.join("robots").join(file);
        tried.push((robots, "in the crate's directory `robots`".to_owned()));
    }
    if let Some((path, _)) = tried.iter().find(|(path, _)| path.is_file()) {
        return Ok(LocatedSpec {
            shown: shown(path),
            absolute: path.canonicalize().unwrap_or_else(|_| path.clone()),
        });
    }
    let mut message = format!("no spec `{file}`; looked for it");
    for (k, (_, place)) in tried.iter().enumerate() {
        message.push_str(if k == 0 { " " } else { ", " });
        message.push_str(place);
    }
    let near = nearest(file, tried.iter().filter_map(|(path, _)| path.parent()));
    if let Some(name) = near {
        let _ = write!(message, "; did you mean `{name}`?");
    }
    Err(message)
}

/// The YAML file in these directories with the most similar name, if one is similar enough.
fn nearest<'a>(file: &str, dirs: impl Iterator<Item = &'a Path>) -> Option<String> {
    let wanted = Path::new(file);
    let name = wanted.file_name()?.to_string_lossy().into_owned();
    let mut best: Option<(usize, String)> = None;
    for dir in dirs {
        let Ok(entries) = fs::read_dir(dir) else {
            continue;
        };
        for entry in entries.flatten() {
            let other = entry.file_name().to_string_lossy().into_owned();
            let spec = [".yaml", ".yml"].iter().any(|end| other.ends_with(end));
            let distance = strsim::damerau_levenshtein(&name, &other);
            if !spec || distance * 3 > name.chars().count() {
                continue;
            }
            let path = wanted.with_file_name(&other).display().to_string();
            // Sorted by name among equally similar ones, since the order of a directory is not
            // fixed.
            if best
                .as_ref()
                .is_none_or(|b| (distance, &path) < (b.0, &b.1))
            {
                best = Some((distance, path));
            }
        }
    }
    best.map(|(_, path)| path)
}

fn shown(path: &Path) -> String {
    let relative = env::current_dir()
        .ok()
        .and_then(|dir| path.strip_prefix(dir).ok().map(Path::to_owned));
    relative.as_deref().unwrap_or(path).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_near_name_is_suggested_and_a_far_one_is_not() {
        let robots = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../robots"));
        let near = |name: &str| nearest(name, [robots].into_iter());
        assert_eq!(near("3rsp.yaml").as_deref(), Some("3rps.yaml"));
        assert_eq!(near("sub/3rps.yml").as_deref(), Some("sub/3rps.yaml"));
        assert_eq!(near("excavator.yaml"), None);
    }
}
