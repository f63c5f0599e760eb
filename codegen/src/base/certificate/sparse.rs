//! Rows that store only their nonzero entries: the energies of a body in a branching chain depend on
//! few of the parameters.

use super::float320::Float320;

/// A row, as its nonzero entries with their columns, which ascend.
#[derive(Clone, Debug, Default)]
pub(super) struct Row(Vec<(u32, Float320)>);

impl Row {
    /// The row of all entries, from column 0 on.
    pub(super) fn of(entries: impl IntoIterator<Item = Float320>) -> Row {
        let entries = (0_u32..).zip(entries);
        Row(entries.filter(|(_, x)| !x.is_zero()).collect())
    }

    /// The nonzero entries with their columns, in the order of columns.
    pub(super) fn entries(&self) -> impl Iterator<Item = (usize, &Float320)> {
        self.0.iter().map(|(c, x)| (*c as usize, x))
    }

    /// The number of nonzero entries.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    fn find(&self, column: usize) -> Result<usize, usize> {
        self.0.binary_search_by_key(&column, |(c, _)| *c as usize)
    }

    /// The entry of a column, if it is not 0.
    pub(super) fn entry(&self, column: usize) -> Option<&Float320> {
        self.find(column).ok().map(|at| &self.0[at].1)
    }

    /// The entry of a column.
    pub(super) fn get(&self, column: usize) -> Float320 {
        self.entry(column).copied().unwrap_or(Float320::ZERO)
    }

    /// The magnitude of the largest entry; 0 for an empty row.
    pub(super) fn largest(&self) -> Float320 {
        let entries = self.0.iter();
        entries.fold(Float320::ZERO, |m, (_, x)| m.max(x.abs()))
    }

    /// The row restricted to these columns, renumbered in the given order.
    pub(super) fn of_columns(&self, columns: &[usize]) -> Row {
        let entries = (0_u32..).zip(columns);
        Row(entries
            .filter_map(|(k, c)| Some((k, *self.entry(*c)?)))
            .collect())
    }

    /// The row without the entries of the columns before the given one.
    pub(super) fn starting_at(mut self, column: usize) -> Row {
        let (Ok(at) | Err(at)) = self.find(column);
        self.0.drain(..at);
        self
    }

    /// Appends the entries of another row, whose column 0 becomes column `width`.
    pub(super) fn append(&mut self, width: usize, other: &Row) {
        let shifted = other.0.iter().map(|(c, x)| (*c + width as u32, *x));
        self.0.extend(shifted);
    }

    /// Subtracts a multiple of another row; the entry at `column` becomes 0. `space` is overwritten;
    /// `filled` is called with the columns where there was no entry before.
    pub(super) fn reduce(
        &mut self,
        factor: Float320,
        other: &Row,
        column: usize,
        space: &mut Row,
        mut filled: impl FnMut(usize),
    ) {
        let result = &mut space.0;
        result.clear();
        let mut own = self.0.iter().peekable();
        for (c, p) in &other.0 {
            while let Some(entry) = own.next_if(|(o, _)| o < c) {
                result.push(*entry);
            }
            let before = own.next_if(|(o, _)| o == c);
            if *c as usize == column {
                continue;
            }
            let x = before.map_or(Float320::ZERO, |(_, x)| *x) - factor * *p;
            if x.is_zero() {
                continue;
            }
            if before.is_none() {
                filled(*c as usize);
            }
            result.push((*c, x));
        }
        result.extend(own);
        core::mem::swap(&mut self.0, result);
    }
}
