//! Named arrays of numbers in files of laboratories, as tables.
//!
//! | format | first bytes | paths of arrays |
//! |---|---|---|
//! | NPY, NPZ of NumPy | `\x93NUMPY`, `PK` | `q`, fields of records as `data.q` |
//! | MAT of MATLAB, levels 4, 5 and 7.3 | a head of zeros, `MATLAB 5.0`, HDF5 | `data.q`, `state[3].q`, cells as `c[2]` |
//! | HDF5 | `\x89HDF` | `group/q`, members of compounds as `group/data.q` |
//! | MDF 4 of ASAM | `MDF     4` | `group/channel` |
//! | TDMS of LabVIEW | `TDSm` | `group/channel` |
//!
//! A file is opened as [`Table`]s: the arrays that have as many rows as a time, with the columns of
//! matrices as `q[:,2]`, counted from 0. What a table leaves out is told by [`Table::why_absent`].
//!
//! Sizes that a file claims are checked against its length before memory is taken for them; what is
//! compressed takes memory as it is decompressed.

mod array;
mod error;
mod hdf5;
mod input;
mod mat;
mod mat4;
mod mdf;
mod npy;
mod number;
mod table;
mod tdms;
mod zip;

use std::path::Path;

use self::array::Found;
use self::error::{Read, Why, refused};
use self::input::Input;

pub use error::ArrayError;
pub use table::{Matrix, Table};

/// The formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Npy,
    Zip,
    Mat,
    Mat4,
    Hdf5,
    Mdf,
    Tdms,
    /// One that is not read, with a sentence that says what to do.
    Other(&'static str),
}

/// Bytes from which a format is known: HDF5 may begin at 512.
pub const START_BYTES: u64 = 520;

/// Formats that are not read, by their first bytes, with what to do with them.
const OTHERS: [(&[u8], &str); 2] = [
    (
        b"ULog\x01\x12\x35",
        "this is a ULog of PX4: convert it to CSV, one file a topic, by `ulog2csv` of pyulog",
    ),
    (
        b"\xd0\xcf\x11\xe0",
        "this is a workbook of a spreadsheet: save the sheet with the log as CSV",
    ),
];

impl Format {
    fn of(start: &[u8]) -> Option<Self> {
        let other = OTHERS.iter().find(|(magic, _)| start.starts_with(magic));
        if let Some((_, why)) = other {
            return Some(Self::Other(why));
        }
        if start.starts_with(npy::MAGIC) {
            Some(Self::Npy)
        } else if start.starts_with(zip::MAGIC) {
            Some(Self::Zip)
        } else if mat::begins(start) {
            Some(Self::Mat)
        } else if mat4::begins(start) {
            Some(Self::Mat4)
        } else if hdf5::begin(start).is_some() {
            Some(Self::Hdf5)
        } else if start.starts_with(mdf::MAGIC) || start.starts_with(mdf::UNFINISHED) {
            Some(Self::Mdf)
        } else if start.starts_with(tdms::MAGIC) {
            Some(Self::Tdms)
        } else {
            None
        }
    }
}

/// Whether a file is in one of the formats, or in one for which [`open`] says what to do with it.
///
/// - `start`: its first bytes, at least [`START_BYTES`] of a longer file.
///
/// ```
/// assert!(regen_arrays::is_arrays(b"\x93NUMPY\x01\x00"));
/// assert!(!regen_arrays::is_arrays(b"t,q1\n0,1\n"));
/// ```
pub fn is_arrays(start: &[u8]) -> bool {
    Format::of(start).is_some()
}

/// Opens a file as tables: one for each time in it, or one of all arrays of the usual length.
///
/// - `time`: the path of the array of times, where it is not `t` or `time`.
///
/// # Errors
/// When the file cannot be read, is broken, has no numbers, or is in a format that is not read.
pub fn open(path: &Path, time: Option<&str>) -> Result<Vec<Table>, ArrayError> {
    let failed = |why: Why| ArrayError::new(path, why);
    let mut input = Input::open(path).map_err(|error| failed(error.into()))?;
    let found = read(&mut input, path).map_err(failed)?;
    if found.arrays.is_empty() {
        let unread: Vec<String> = found
            .unread
            .iter()
            .take(10)
            .map(|(p, why)| format!("{p}: {why}"))
            .collect();
        let reasons = if unread.is_empty() {
            String::new()
        } else {
            format!("; {}", unread.join("; "))
        };
        let why = format!("it has no arrays of numbers{reasons}");
        return Err(failed(Why::Refused(why)));
    }
    if let Some(first) = found.arrays.first()
        && found.arrays.iter().all(|own| own.count() == Some(1))
    {
        let why = format!(
            "its arrays have one number each, such as `{}`: save each signal as an array, in MATLAB \
             `q = [log.q]` of a struct array",
            first.name
        );
        return Err(failed(Why::Refused(why)));
    }
    let mut tables = Table::all(path, found, time);
    for own in &mut tables {
        own.find_date(&mut input).map_err(failed)?;
    }
    Ok(tables)
}

fn read(input: &mut Input, path: &Path) -> Read<Found> {
    let start = input.up_to(0, START_BYTES)?;
    let found = match Format::of(&start) {
        Some(Format::Npy) => {
            let name = path
                .file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            npy::open(input, &name)?
        }
        Some(Format::Zip) => npy::open_zip(input)?,
        Some(Format::Mat) => mat::open(input, &start)?,
        Some(Format::Mat4) => mat4::open(input)?,
        Some(Format::Hdf5) => hdf5::open(input, &start)?,
        Some(Format::Mdf) => mdf::open(input, &start)?,
        Some(Format::Tdms) => tdms::open(input)?,
        Some(Format::Other(why)) => return refused(why),
        None => return refused("it is in none of the formats"),
    };
    array::require_few(found.arrays.len())?;
    Ok(found)
}
