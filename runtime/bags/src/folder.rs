//! Which files a recording consists of, and what they are.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::BagError;

/// How a file of a recording stores its messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Mcap,
    Sqlite,
}

/// A file of a recording.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) path: PathBuf,
    pub(crate) kind: Kind,
}

const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";
const ROS1_MAGIC: &[u8] = b"#ROSBAG";
const METADATA: &str = "metadata.yaml";
/// Largest metadata, bytes; they list topics and files.
const MAX_METADATA_BYTES: u64 = 1 << 22;

/// Opens a file; pipes and devices, which can be read only once or never end, are refused before.
fn open(path: &Path) -> std::io::Result<File> {
    let found = std::fs::metadata(path)?;
    if !found.is_file() && !found.is_dir() {
        return Err(std::io::Error::other("this is a pipe or a device"));
    }
    File::open(path)
}

/// The first bytes of a file.
fn start(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(16).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn extension(path: &Path) -> Option<&str> {
    path.extension()?.to_str()
}

/// Whether a path is a recording: a folder or its `metadata.yaml`, a file that begins as a recording
/// or is named as one.
///
/// - `start`: its first bytes, at least 16 of a longer file.
///
/// ```
/// use std::path::Path;
///
/// let dir = std::env::temp_dir();
/// assert!(regen_bags::is_bag(&dir, b""), "a folder can only be a bag");
/// assert!(regen_bags::is_bag(Path::new("missing.mcap"), b""));
/// assert!(regen_bags::is_bag(Path::new("run1"), b"SQLite format 3\0"));
/// assert!(!regen_bags::is_bag(Path::new("run1.csv"), b"t,q1\n"));
/// ```
pub fn is_bag(path: &Path, start: &[u8]) -> bool {
    let metadata = path.file_name().is_some_and(|name| name == METADATA);
    if metadata || path.is_dir() || matches!(extension(path), Some("mcap" | "db3" | "bag")) {
        return true;
    }
    [mcap::MAGIC, SQLITE_MAGIC, ROS1_MAGIC]
        .iter()
        .any(|magic| start.starts_with(magic))
}

/// The file of a recording at a path.
fn part(path: &Path) -> Result<Part, BagError> {
    let refused = |why: &str| BagError::NotABag {
        file: path.to_path_buf(),
        why: why.to_owned(),
    };
    let bytes = start(path).map_err(|source| BagError::Io {
        file: path.to_path_buf(),
        source,
    })?;
    let kind = if bytes.starts_with(mcap::MAGIC) {
        Kind::Mcap
    } else if bytes.starts_with(SQLITE_MAGIC) {
        Kind::Sqlite
    } else if bytes.is_empty() {
        return Err(refused("it is empty"));
    } else if bytes.starts_with(ROS1_MAGIC) {
        return Err(refused(
            "this is a bag of ROS 1: `rosbags-convert` (PyPI: rosbags) makes one of ROS 2 of it",
        ));
    } else if crate::compression::is_zstd(&bytes) {
        return Err(refused(
            "the whole file is compressed: `zstd -d` decompresses it; or convert the bag with \
             `ros2 bag convert`",
        ));
    } else {
        return Err(refused(
            "its first bytes are neither those of an MCAP file nor of an SQLite database",
        ));
    };
    Ok(Part {
        path: path.to_path_buf(),
        kind,
    })
}

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    relative_file_paths: Vec<String>,
    custom_data: Option<Custom>,
}

/// What the user had the recorder write.
#[derive(Deserialize)]
#[serde(untagged)]
#[allow(
    clippy::zero_sized_map_values,
    reason = "the values may be of any kind, and only the names are told"
)]
enum Custom {
    Named(BTreeMap<String, IgnoredAny>),
    Other(IgnoredAny),
}

/// The files of a recording, in their order, and the names of what is written beside them.
pub(crate) fn parts(path: &Path) -> Result<(Vec<Part>, BTreeSet<String>), BagError> {
    let metadata = path.file_name().is_some_and(|name| name == METADATA);
    let path = match path.parent().filter(|_| metadata) {
        Some(folder) => folder,
        None if path.is_dir() => path,
        None => return Ok((vec![part(path)?], BTreeSet::new())),
    };
    let refused = |why: String| BagError::NotABag {
        file: path.to_path_buf(),
        why,
    };
    let metadata = path.join(METADATA);
    if !metadata.exists() {
        return Err(refused(
            "this folder has no metadata.yaml and is not a bag: name a file in it, or let \
             `ros2 bag reindex` write the metadata"
                .to_owned(),
        ));
    }
    let mut text = String::new();
    let read =
        open(&metadata).and_then(|file| file.take(MAX_METADATA_BYTES).read_to_string(&mut text));
    read.map_err(|source| BagError::Io {
        file: metadata.clone(),
        source,
    })?;
    let found: Metadata = serde_saphyr::from_str(&text).map_err(|error| BagError::NotABag {
        file: metadata,
        why: format!("{error}; `ros2 bag reindex` writes the metadata of a bag"),
    })?;
    let Information {
        relative_file_paths: files,
        custom_data,
    } = found.rosbag2_bagfile_information;
    if files.is_empty() {
        return Err(refused("its metadata.yaml lists no file".to_owned()));
    }
    let place = |name: &String| {
        let own = path.join(name);
        // the first version of the metadata has the folder in the names
        let last = Path::new(name).file_name();
        match last.filter(|_| !own.exists()) {
            Some(last) => path.join(last),
            None => own,
        }
    };
    let beside = match custom_data {
        Some(Custom::Named(all)) => all.into_keys().collect(),
        Some(Custom::Other(IgnoredAny)) | None => BTreeSet::new(),
    };
    let parts: Result<_, _> = files.iter().map(|name| part(&place(name))).collect();
    Ok((parts?, beside))
}
