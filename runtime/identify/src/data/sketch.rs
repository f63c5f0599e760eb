//! A sample of a log's rows by which two logs are compared: rows that are in both count twice, and
//! deviations computed from them are too small.

use std::collections::BTreeSet;

/// The number of rows that are kept, those with the smallest hashes: the same ones of equal logs.
const KEPT: usize = 1024;
/// The part of a log's rows that another one must have; rounded rows of a robot at rest may be equal.
const MIN_PART: f64 = 0.1;
/// The least number of kept rows that are equal.
const MIN_EQUAL: usize = 16;

/// The smallest hashes of a log's rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sketch {
    hashes: BTreeSet<u64>,
    last: u64,
    /// Whether there are rows that are not kept.
    full: bool,
}

impl Sketch {
    /// Adds a row.
    ///
    /// - `values`: its entries without the time, as a copy may begin at another one.
    pub(super) fn push(&mut self, values: &[f64]) {
        let mut hash = 0x9e37_79b9_7f4a_7c15_u64;
        for value in values {
            hash = (hash ^ value.to_bits()).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            hash ^= hash >> 29;
        }
        // rows that repeat are those of a robot at rest
        if core::mem::replace(&mut self.last, hash) == hash {
            return;
        }
        if self.full && self.hashes.last().is_some_and(|most| hash > *most) {
            return;
        }
        self.hashes.insert(hash);
        if self.hashes.len() > KEPT {
            self.hashes.pop_last();
            self.full = true;
        }
    }

    /// The part of the rows that are in the other log too; `None` if they are few.
    pub(super) fn part_in(&self, other: &Self) -> Option<f64> {
        let most = |own: &Self| own.hashes.last().copied().filter(|_| own.full);
        let bound = most(self)
            .unwrap_or(u64::MAX)
            .min(most(other).unwrap_or(u64::MAX));
        let (mut all, mut equal) = (0, 0);
        for hash in self.hashes.range(..=bound) {
            all += 1;
            equal += usize::from(other.hashes.contains(hash));
        }
        let part = equal as f64 / f64::from(all.max(1));
        (equal >= MIN_EQUAL && part >= MIN_PART).then_some(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sketch(rows: impl IntoIterator<Item = usize>) -> Sketch {
        let mut out = Sketch::default();
        for k in rows {
            let t = 0.01 * k as f64;
            out.push(&[t.sin(), (3.0 * t).cos()]);
        }
        out
    }

    #[test]
    fn equal_and_overlapping_logs_are_found_with_the_part_that_they_share() {
        let whole = sketch(0..20_000);
        assert_eq!(whole.part_in(&sketch(0..20_000)), Some(1.0));
        let second = sketch(15_000..40_000);
        let part = whole.part_in(&second).unwrap_or_default();
        assert!((part - 0.25).abs() < 0.05, "{part}");
        let part = second.part_in(&whole).unwrap_or_default();
        assert!((part - 0.2).abs() < 0.05, "{part}");
        assert_eq!(whole.part_in(&sketch(20_000..40_000)), None);
        // both begin at rest
        let rests = |from: usize| sketch((0..5000).map(|_| 7).chain(from..from + 5000));
        assert_eq!(rests(100).part_in(&rests(50_000)), None);
        assert_eq!(sketch([]).part_in(&sketch([])), None);
    }
}
