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
    /// Whether its numbers are dates or spans of time by their type, and thus in s.
    pub(crate) is_clock: bool,
    /// The unit that the file states; empty without one.
    pub(crate) unit: String,
    /// Names beside that in its path.
    pub(crate) other_names: Vec<String>,
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
            is_clock: false,
            unit: String::new(),
            other_names: Vec::new(),
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

    /// The date from which the times of an array count, ns since 1970; `None` if that is not known.
    fn date(&self, _: &mut Input, _: usize) -> Read<Option<i64>> {
        Ok(None)
    }
}

/// The arrays of a file.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) arrays: Vec<Array>,
    /// What is not read, by its path, and why.
    pub(crate) unread: Vec<(String, String)>,
    pub(crate) container: Box<dyn Container>,
}

/// The number of characters of a remark that are shown.
const MAX_SHOWN: usize = 60;

/// What a file says of its arrays that is not applied to their numbers: by its kind and name the first array, and
/// whether others have it too.
#[derive(Debug, Default)]
pub(crate) struct Remarks(BTreeMap<(&'static str, String), (String, bool)>);

impl Remarks {
    /// Keeps one, in one line; nothing of one without words.
    ///
    /// - `kind`: what the format calls it.
    pub(crate) fn add(&mut self, kind: &'static str, name: &str, array: &str) {
        let mut words = name.split_whitespace().collect::<Vec<_>>().join(" ");
        if words.chars().count() > MAX_SHOWN {
            words = words.chars().take(MAX_SHOWN).chain("..".chars()).collect();
        }
        if !words.is_empty() {
            let first = || (array.to_owned(), false);
            let own = self.0.entry((kind, words)).or_insert_with(first);
            own.1 |= own.0 != array;
        }
    }

    /// Keeps the names of states of an array with their numbers.
    pub(crate) fn add_states(&mut self, states: &[(f64, String)], array: &str) {
        let all = states
            .iter()
            .map(|(number, name)| format!("{name} = {number}"));
        self.add("states", &all.collect::<Vec<_>>().join(", "), array);
    }

    /// Tells them as what is not read.
    pub(crate) fn tell(self, unread: &mut Vec<(String, String)>) {
        unread.extend(
            self.0
                .into_iter()
                .map(|((kind, name), (array, has_others))| {
                    let others = if has_others { " and of others" } else { "" };
                    let whose = if array.is_empty() { "the file" } else { &array };
                    let why = format!("{kind} of {whose}{others}, not applied to numbers");
                    (name, why)
                }),
        );
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
