//! Reads the files of a folder, writes them atomically, and removes old ones when they take too much
//! space.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// The extension of an entry's file.
pub(crate) const EXTENSION: &str = "regen";

/// The extension of a file that is being written.
const PART: &str = "regen-part";

/// Parts older than this were left by interrupted writers.
const ABANDONED: Duration = Duration::from_hours(1);

/// The bytes of a file.
pub(crate) fn read(path: &Path) -> Option<Vec<u8>> {
    fs::read(path).ok()
}

/// Marks an entry as used now. If that is not permitted, the entry is removed early at worst.
pub(crate) fn touch(path: &Path) {
    let file = File::options().append(true).open(path);
    let _ = file.and_then(|file| file.set_modified(SystemTime::now()));
}

/// Removes a file. Another process may have done so.
pub(crate) fn remove(path: &Path) {
    let _ = fs::remove_file(path);
}

/// Writes a file under a temporary name and renames it, so that readers find all of it or nothing.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    if let Some(folder) = path.parent() {
        make(folder)?;
    }
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let part = path.with_extension(format!("{}-{number}.{PART}", std::process::id()));
    let written = File::create_new(&part)
        .and_then(|mut file| file.write_all(bytes))
        .and_then(|()| fs::rename(&part, path));
    if written.is_err() {
        remove(&part);
    }
    written
}

/// Makes a folder that only the user may enter.
fn make(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// Removes abandoned parts, and the least recently used entries until the others take at most
/// `limit` bytes. Files with other names are not touched.
pub(crate) fn shrink(folder: &Path, limit: u64) {
    let Ok(files) = fs::read_dir(folder) else {
        return;
    };
    let mut entries: Vec<(SystemTime, PathBuf, u64)> = Vec::new();
    for file in files.flatten() {
        let path = file.path();
        let Ok(facts) = file.metadata() else { continue };
        let Ok(used) = facts.modified() else { continue };
        if !facts.is_file() {
            continue;
        }
        if has_name(&path, EXTENSION) {
            entries.push((used, path, facts.len()));
        } else if has_name(&path, PART) && used.elapsed().is_ok_and(|age| age > ABANDONED) {
            remove(&path);
        }
    }
    entries.sort();
    let mut all: u64 = entries.iter().map(|(.., size)| size).sum();
    for (_, path, size) in entries {
        if all <= limit {
            break;
        }
        remove(&path);
        all -= size;
    }
}

/// Whether a file has the name of an entry or a part: 64 hexadecimal digits, and an extension.
fn has_name(path: &Path, extension: &str) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    let Some((key, rest)) = name.and_then(|name| name.split_once('.')) else {
        return false;
    };
    let digits = key.len() == 64 && key.bytes().all(|byte| byte.is_ascii_hexdigit());
    digits && rest.rsplit('.').next() == Some(extension)
}
