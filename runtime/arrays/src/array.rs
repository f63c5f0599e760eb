//! What each format gives: named arrays of numbers.

use core::fmt::Debug;
use std::collections::BTreeMap;

use crate::error::{Read, refused};
use crate::input::Input;

/// The largest number of arrays of a file.
pub(crate) const MAX_ARRAYS: usize = 20_000;

/// A named array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    /// Its path in the file, such as `data.q` or `arm/q`.
    pub(crate) name: String,
    pub(crate) shape: Vec<u64>,
    /// Whether numbers that are next to each other differ in the first index, as in MATLAB.
    pub(crate) columns_first: bool,
    /// Its number for [`Container::numbers`].
    pub(crate) place: usize,
    /// The part of the file with times of its own; that of arrays without such parts is `None`.
    pub(crate) group: Option<usize>,
    /// Whether the format says that it is the time of its part.
    pub(crate) is_time: bool,
    /// The unit that the file states; empty without one.
    pub(crate) unit: String,
}

impl Array {
    pub(crate) fn new(name: String, shape: Vec<u64>) -> Self {
        Self {
            name,
            shape,
            columns_first: false,
            place: 0,
            group: None,
            is_time: false,
            unit: String::new(),
        }
    }

    /// The number of its numbers, if there are addresses for so many.
    pub(crate) fn count(&self) -> Option<usize> {
        let count = self
            .shape
            .iter()
            .try_fold(1_u64, |all, n| all.checked_mul(*n))?;
        usize::try_from(count).ok()
    }
}

/// A file in one of the formats.
pub(crate) trait Container: Debug + Send + Sync {
    /// All numbers of an array, in the order of the file.
    fn numbers(&self, input: &mut Input, place: usize) -> Read<Vec<f64>>;
}

/// The arrays of a file.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) arrays: Vec<Array>,
    /// What is not read, by its path, and why.
    pub(crate) unread: Vec<(String, String)>,
    pub(crate) container: Box<dyn Container>,
}

/// What a file says of its arrays that is not applied to their numbers: by its name the first array, and whether
/// others have it too.
#[derive(Debug, Default)]
pub(crate) struct Remarks(BTreeMap<String, (String, bool)>);

impl Remarks {
    pub(crate) fn add(&mut self, name: &str, array: &str) {
        let first = || (array.to_owned(), false);
        let own = self.0.entry(name.to_owned()).or_insert_with(first);
        own.1 |= own.0 != array;
    }

    /// Tells them as what is not read.
    ///
    /// - `kind`: what the format calls them.
    pub(crate) fn tell(self, kind: &str, unread: &mut Vec<(String, String)>) {
        unread.extend(self.0.into_iter().map(|(name, (array, has_others))| {
            let others = if has_others { " and of others" } else { "" };
            let whose = if array.is_empty() { "the file" } else { &array };
            let why = format!("{kind} of {whose}{others}, which is not applied to numbers");
            (name, why)
        }));
    }
}

/// Refuses more arrays than any log has.
pub(crate) fn require_few(count: usize) -> Read<()> {
    if count > MAX_ARRAYS {
        return refused(format!(
            "it has more than {MAX_ARRAYS} arrays: save those of the log in a file of their own"
        ));
    }
    Ok(())
}
