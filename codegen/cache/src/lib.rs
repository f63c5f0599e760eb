//! Keeps derived robots in a folder of the user, so that each is derived once.
//!
//! A [`Cache`] is a [`Store`] of `regen_codegen`: a result is found by the digest of the spec's text
//! and of the generator (its sources, its version, the compiler, the crates that it uses), so that
//! an edit of either makes another entry, and old entries are never read again.
//!
//! Any number of processes may use the folder at once. An entry is written to a temporary file,
//! which is then renamed; it carries a digest of its contents, and a damaged entry is removed and
//! derived again. Where the folder cannot be read or written, everything is derived as if there
//! were no cache. When all entries together take more than [`LIMIT`] bytes, the least recently
//! used are removed. The folder must belong to the user, since generated source that it contains
//! is compiled.

mod entry;
mod folder;
mod place;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use regen_codegen::store::{Key, Store};

pub use place::{VARIABLE, folder_of_user};

/// The largest size of all entries by default, bytes.
pub const LIMIT: u64 = 256 << 20;

/// By default, results that are derived in less time than this are not cached: reading them would
/// save nothing.
pub const MIN_TIME: Duration = Duration::from_millis(50);

/// A folder with results of derivations.
///
/// ```
/// use regen_cache::Cache;
/// use regen_codegen::store::Key;
///
/// let folder = std::env::temp_dir().join(format!("regen-cache-doc-{}", std::process::id()));
/// let cache = Cache::at(&folder);
/// let key = Key::new("example", &[b"the text of a spec"]);
/// assert_eq!(cache.read(&key), None);
/// cache.write(&key, b"what was derived from it")?;
/// assert_eq!(cache.read(&key).as_deref(), Some(&b"what was derived from it"[..]));
/// # std::fs::remove_dir_all(&folder)?;
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    limit: u64,
    min_time: Duration,
    /// The time at which each result that was not found was asked for, which is when its derivation
    /// began.
    sought: Mutex<BTreeMap<Key, Instant>>,
}

impl Cache {
    /// The cache in a folder, which is made when something is first written.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self {
            folder: folder.into(),
            limit: LIMIT,
            min_time: MIN_TIME,
            sought: Mutex::default(),
        }
    }

    /// The cache in the user's folder, as [`folder_of_user`] finds it; `None` where there is none,
    /// or the user wants none.
    pub fn of_user() -> Option<Self> {
        folder_of_user(|name| std::env::var_os(name)).map(Self::at)
    }

    /// The same folder with another limit for the size of all entries, bytes, which is enforced
    /// after each [`write`](Self::write).
    #[must_use]
    pub fn with_limit(self, limit: u64) -> Self {
        Self { limit, ..self }
    }

    /// The same folder, caching the results that take at least this time to derive.
    #[must_use]
    pub fn with_min_time(self, min_time: Duration) -> Self {
        Self { min_time, ..self }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The bytes that were written for a key; `None` if there are none, or they are damaged.
    pub fn read(&self, key: &Key) -> Option<Vec<u8>> {
        let path = self.path(key);
        let file = folder::read(&path)?;
        let found = entry::open(file, key);
        if found.is_some() {
            folder::touch(&path);
        } else {
            folder::remove(&path);
        }
        found
    }

    /// Writes bytes for a key, then removes old entries if all take more than the limit. Bytes
    /// that take more than a quarter of the limit are not written, since they would displace too
    /// many other entries.
    ///
    /// # Errors
    /// If the folder cannot be made or the file cannot be written; no part of it is left.
    pub fn write(&self, key: &Key, bytes: &[u8]) -> io::Result<()> {
        if bytes.len() as u64 > self.limit / 4 {
            return Ok(());
        }
        folder::write(&self.path(key), &entry::seal(key, bytes))?;
        folder::shrink(&self.folder, self.limit);
        Ok(())
    }

    fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(format!("{key}.{}", folder::EXTENSION))
    }
}

impl Store for Cache {
    fn get(&self, key: &Key) -> Option<Vec<u8>> {
        let found = self.read(key);
        if found.is_none()
            && let Ok(mut sought) = self.sought.lock()
        {
            sought.insert(*key, Instant::now());
        }
        found
    }

    fn put(&self, key: &Key, bytes: &dyn Fn() -> Option<Vec<u8>>) {
        let since = self.sought.lock().ok().and_then(|mut s| s.remove(key));
        if since.is_some_and(|since| since.elapsed() >= self.min_time)
            && let Some(bytes) = bytes()
        {
            // a failure to write costs a second derivation, and nothing else
            let _ = self.write(key, &bytes);
        }
    }
}
