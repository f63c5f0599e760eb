//! Where the user's cache is.

use std::ffi::OsString;
use std::path::PathBuf;

/// The environment variable that names another folder, or is `off`.
pub const VARIABLE: &str = "REGEN_CACHE";

/// The folder of the user's cache, from the environment variables that `variable` gives:
/// `REGEN_CACHE` if it is set (`off`: none), else a folder `regen` in the system's place for such
/// files: `$XDG_CACHE_HOME` or `~/.cache`, on macOS `~/Library/Caches`, on Windows
/// `%LOCALAPPDATA%`. `None` where there is no such place.
///
/// ```
/// use regen_cache::folder_of_user;
///
/// let named = |name: &str| (name == "REGEN_CACHE").then(|| "/somewhere".into());
/// assert_eq!(folder_of_user(named), Some("/somewhere".into()));
/// let off = |name: &str| Some(if name == "REGEN_CACHE" { "off" } else { "/home" }.into());
/// assert_eq!(folder_of_user(off), None);
/// ```
pub fn folder_of_user(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let set = |name: &str| variable(name).filter(|value| !value.is_empty());
    if let Some(named) = set(VARIABLE) {
        return (named != "off").then(|| PathBuf::from(named));
    }
    // a relative folder would be another one in each working directory
    let absolute = |name: &str| set(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let place = if cfg!(windows) {
        absolute("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        absolute("HOME").map(|home| home.join("Library").join("Caches"))
    } else {
        absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))
    };
    place.map(|place| place.join("regen"))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn relative_and_empty_variables_are_ignored() {
        let found = |cache: &str, home: &str| {
            folder_of_user(|name| match name {
                "XDG_CACHE_HOME" => Some(cache.into()),
                "HOME" => Some(home.into()),
                _ => Some("".into()),
            })
        };
        assert_eq!(found("/c", "/h"), Some("/c/regen".into()));
        assert_eq!(found("c", "/h"), Some("/h/.cache/regen".into()));
        assert_eq!(found("", "h"), None);
    }
}
