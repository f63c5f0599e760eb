//! Rows that wait until many of them are reduced into a QR factor at once.

use super::{EstimateError, QrFactor};
use crate::qr_update::BLOCK;

/// Entries from one column to the next: not a power of two, with which the entries of a row would
/// all fall into the same few sets of a cache.
const STRIDE: usize = BLOCK + 8;

/// Up to [`BLOCK`] rows, column by column, with their right-hand sides.
#[derive(Clone, Debug)]
pub(crate) struct RowBlock {
    columns: Vec<f64>,
    side: Vec<f64>,
}

impl RowBlock {
    /// An empty block of rows with this many entries.
    pub(crate) fn new(columns: usize) -> Self {
        Self {
            columns: vec![0.0; columns * STRIDE],
            side: Vec::with_capacity(BLOCK),
        }
    }

    /// Adds a row; entries that are not given are 0. Returns the number of entries that were given,
    /// at most as many as there are columns. [`flush`](Self::flush) a full block before.
    pub(crate) fn push(&mut self, row: impl Iterator<Item = f64>, side: f64) -> usize {
        let at = self.side.len();
        let mut given = 0;
        let mut columns = self.columns.as_chunks_mut::<STRIDE>().0.iter_mut();
        for (column, entry) in columns.by_ref().zip(row) {
            column[at] = entry;
            given += 1;
        }
        for column in columns {
            column[at] = 0.0;
        }
        self.side.push(side);
        given
    }

    /// Whether the block is full.
    pub(crate) fn is_full(&self) -> bool {
        self.side.len() >= BLOCK
    }

    /// Moves the rows into a factor.
    ///
    /// # Errors
    /// When an entry is not finite; the factor is then unchanged.
    pub(crate) fn flush(&mut self, factor: &mut QrFactor) -> Result<(), EstimateError> {
        let rows = self.side.len();
        let mut packed = Vec::with_capacity(self.columns.len() / STRIDE * rows);
        for column in self.columns.as_chunks::<STRIDE>().0 {
            packed.extend_from_slice(&column[..rows]);
        }
        factor.push_owned(packed, &mut self.side)?;
        self.side.clear();
        Ok(())
    }
}
