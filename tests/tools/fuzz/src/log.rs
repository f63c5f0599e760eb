//! Targets for logs: CSV and Parquet files, files of arrays and recordings: all columns as they are, and equations with
//! every method of differentiation.

use std::cell::RefCell;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use regen_identify::data::{DataError, Logs, Policy, RawLog, Run, Settings};
use regen_identify::identify::{EquationKind, observe};
use regen_identify::signals::Method;

mod model {
    #![allow(missing_docs, unreachable_pub, dead_code)]
    include!("../../../../runtime/tests/models/pendulum.rs");
    include!("../../../../runtime/tests/models/pendulum_base.rs");
}

/// A temporary file of this thread, deleted when the thread ends.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Self {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("regen-fuzz-{}-{number}", std::process::id());
        // in memory, if the system has such a directory
        let shared = Path::new("/dev/shm");
        let dir = if shared.is_dir() {
            shared.to_path_buf()
        } else {
            std::env::temp_dir()
        };
        Self(dir.join(name))
    }

    fn fill(&self, bytes: &[u8]) -> std::io::Result<()> {
        File::create(&self.0)?.write_all(bytes)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::new(Scratch::new());
}

/// Of so many inputs one is identified, by its hash: in long runs that takes nearly all of the time, and they are
/// about the readers.
const IDENTIFIED: u64 = if cfg!(feature = "targets") { 32 } else { 1 };

/// Both results and errors are accepted, but errors must have a message.
fn check_error(error: &DataError) {
    assert!(!error.to_string().is_empty(), "no message");
}

/// Reads all columns of every row.
fn read(path: &Path) {
    let visited = RawLog::open(&Run::from(path), &Settings::default()).and_then(|log| {
        assert!(log.numbers().iter().all(|own| *own < log.titles().len()));
        log.visit(&mut |row| match row {
            Ok((_, values)) => assert_eq!(values.len(), 1 + log.numbers().len()),
            Err(problem) => assert!(!problem.to_string().is_empty(), "no message"),
        })
    });
    if let Err(error) = visited {
        check_error(&error);
    }
}

/// Reads every row with the settings that a number selects, and reduces the resulting equations.
fn identify(path: &Path, selection: u64) {
    let method = match selection % 4 {
        0 => Method::Central,
        1 => Method::Local { half_width: 0.3 },
        2 => Method::Butterworth {
            order: 2,
            cutoff: 2.0,
        },
        _ => Method::Fourier {
            frequency: 0.5,
            harmonics: 2,
        },
    };
    let policy = if (selection / 4).is_multiple_of(2) {
        Policy::Fail
    } else {
        Policy::Drop
    };
    let resample = (selection / 8).is_multiple_of(3).then_some(2.0);
    let settings = Settings {
        method,
        policy,
        resample,
        ..Settings::default()
    };
    match Logs::open(&model::Pendulum, &[path.to_path_buf()], &settings) {
        Err(error) => check_error(&error),
        Ok(mut logs) => match observe(&model::Pendulum, EquationKind::Forces, &mut logs) {
            Err(error) => check_error(&error),
            Ok((set, _)) => assert!(!set.labels().is_empty()),
        },
    }
}

/// A number that depends on every bit of the input (FNV-1a).
fn hash(bytes: &[u8]) -> u64 {
    let mix = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix) >> 7
}

/// Checks a log, CSV or Parquet.
fn log(bytes: &[u8]) {
    SCRATCH.with_borrow(|scratch| {
        if scratch.fill(bytes).is_ok() {
            read(&scratch.0);
            let selection = hash(bytes);
            // other bits than those that select the settings
            if (selection >> 16).is_multiple_of(IDENTIFIED) {
                identify(&scratch.0, selection);
            }
        }
    });
}

/// First bytes of MCAP files and of SQLite databases.
const RECORDINGS: [&[u8]; 2] = [b"\x89MCAP0\r\n", b"SQLite format 3\0"];

/// Checks that a CSV log gives equations or an error.
///
/// # Panics
/// When the reader panics, or its error has no message.
pub fn csv(bytes: &[u8]) {
    log(bytes);
}

/// Checks that a Parquet log gives equations or an error; inputs without the magic number of
/// Parquet are left to [`csv`].
///
/// # Panics
/// When the reader panics, or its error has no message.
pub fn parquet(bytes: &[u8]) {
    if bytes.starts_with(b"PAR1") {
        log(bytes);
    }
}

/// Checks that a recording of robots (MCAP, SQLite) gives equations or an error; inputs that do not
/// begin as one are left to [`csv`].
///
/// # Panics
/// When the reader panics, or its error has no message.
pub fn bag(bytes: &[u8]) {
    if RECORDINGS.iter().any(|magic| bytes.starts_with(magic)) {
        log(bytes);
    }
}

/// First bytes of files of arrays: NPY, NPZ, MAT 5 and 4, HDF5, MDF and TDMS.
const ARRAYS: [&[u8]; 7] = [
    b"\x93NUMPY",
    b"PK\x03\x04",
    b"MATLAB",
    b"\0\0\0\0",
    b"\x89HDF\r\n\x1a\n",
    b"MDF     ",
    b"TDSm",
];

/// Checks that a file of arrays gives equations or an error; inputs that do not begin as one are left
/// to [`csv`].
///
/// # Panics
/// When the reader panics, or its error has no message.
pub fn arrays(bytes: &[u8]) {
    if ARRAYS.iter().any(|magic| bytes.starts_with(magic)) {
        log(bytes);
    }
}
