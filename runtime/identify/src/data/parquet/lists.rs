//! Decodes columns of lists of one length.

use parquet::column::reader::ColumnReaderImpl;
use parquet::data_type::DataType;
use parquet::errors::ParquetError;

use super::Entries;
use super::guard::catch_panic;

/// The length of the first list.
pub(super) fn first_length<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
) -> Result<usize, ParquetError> {
    let (mut definitions, mut repetitions) = (Vec::new(), Vec::new());
    let mut values = Vec::new();
    catch_panic(|| {
        let (some, others) = (Some(&mut definitions), Some(&mut repetitions));
        reader.read_records(1, some, others, &mut values)
    })?;
    Ok(repetitions.len())
}

/// The numbers of the next lists, one list after the other; a list of another length gives `width`
/// entries without a number.
///
/// - `width`: the length of the lists;
/// - `deepest`: the level of elements that are numbers.
pub(super) fn typed<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    rows: usize,
    width: usize,
    deepest: i16,
    number: impl Fn(&T::T) -> f64,
) -> Result<Entries, ParquetError> {
    let (mut definitions, mut repetitions) = (Vec::new(), Vec::new());
    let mut values = Vec::new();
    let mut out: Entries = Vec::with_capacity(rows.saturating_mul(width));
    let mut read = 0;
    // one call reads at most to the end of a page
    while read < rows {
        definitions.clear();
        repetitions.clear();
        values.clear();
        let (records, ..) = catch_panic(|| {
            let (some, others) = (Some(&mut definitions), Some(&mut repetitions));
            reader.read_records(rows - read, some, others, &mut values)
        })?;
        if records == 0 {
            break;
        }
        read += records;
        let mut numbers = values.iter().map(&number);
        let mut list: Entries = Vec::with_capacity(width);
        let mut close = |list: &mut Entries| {
            if list.len() != width {
                list.clear();
                list.resize(width, None);
            }
            out.append(list);
        };
        for (k, (definition, repetition)) in definitions.iter().zip(&repetitions).enumerate() {
            if *repetition == 0 && k > 0 {
                close(&mut list);
            }
            list.push((*definition == deepest).then(|| numbers.next()).flatten());
        }
        close(&mut list);
    }
    Ok(out)
}
