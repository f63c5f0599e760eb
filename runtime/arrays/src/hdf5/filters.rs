//! The filters of chunks: compression, order of bytes, check sums.

use flate2::read::ZlibDecoder;
use std::io::Read as _;

use crate::error::{Read, broken, refused};
use crate::input::Fields;

/// The largest number of filters.
const MAX_FILTERS: u8 = 32;

/// One step of what was done to chunks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Filter {
    id: u16,
    values: Vec<u32>,
}

/// The filters of a data set, the first one that was applied first.
pub(super) fn read(fields: &mut Fields<'_>) -> Read<Vec<Filter>> {
    let (version, count) = (fields.u8()?, fields.u8()?);
    if count > MAX_FILTERS {
        return broken(format!("a data set has {count} filters"));
    }
    fields.skip(if version == 1 { 6 } else { 0 })?;
    let mut out = Vec::new();
    for _ in 0..count {
        let id = fields.u16()?;
        let named = version == 1 || id >= 256;
        let name = if named { usize::from(fields.u16()?) } else { 0 };
        fields.skip(2)?;
        let count = usize::from(fields.u16()?);
        fields.skip(if version == 1 {
            name.next_multiple_of(8)
        } else {
            name
        })?;
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(fields.u32()?);
        }
        fields.skip(if version == 1 && count % 2 == 1 { 4 } else { 0 })?;
        out.push(Filter { id, values });
    }
    Ok(out)
}

impl Filter {
    /// Refuses filters that are not known here.
    pub(super) fn check(&self) -> Read<()> {
        let name = match self.id {
            1..=3 | 32000 => return Ok(()),
            4 => "szip",
            5 => "nbit",
            6 => "scale-offset",
            32001 => "Blosc",
            32004 => "LZ4",
            32008 => "bitshuffle",
            32015 => "Zstandard",
            _ => "another filter",
        };
        refused(format!(
            "it is compressed by {name} (number {}): convert it by `h5repack -f GZIP=4`",
            self.id
        ))
    }

    /// What a chunk was before this filter.
    ///
    /// - `size`: the size of a whole chunk.
    fn undo(&self, bytes: Vec<u8>, size: usize) -> Read<Vec<u8>> {
        match self.id {
            1 => {
                let mut out = Vec::new();
                let limit = (size as u64).saturating_add(8);
                ZlibDecoder::new(&bytes[..])
                    .take(limit)
                    .read_to_end(&mut out)?;
                Ok(out)
            }
            2 => Ok(unshuffled(
                &bytes,
                self.values.first().map_or(1, |own| *own as usize),
            )),
            3 => checked(bytes),
            32000 => unpacked(&bytes, size),
            _ => self.check().map(|()| bytes),
        }
    }
}

/// The bytes of a chunk.
///
/// - `mask`: a bit for each filter that was left out;
/// - `size`: the size of a whole chunk.
pub(super) fn undo(filters: &[Filter], mask: u32, bytes: Vec<u8>, size: usize) -> Read<Vec<u8>> {
    let used = filters.iter().enumerate().rev();
    used.filter(|(k, _)| mask >> k & 1 == 0)
        .try_fold(bytes, |bytes, (_, filter)| filter.undo(bytes, size))
}

/// The bytes of elements, of which first came all first bytes, then all second ones, and so on.
fn unshuffled(bytes: &[u8], element: usize) -> Vec<u8> {
    let element = element.max(1);
    let count = bytes.len() / element;
    let whole = count * element;
    let mut out = Vec::with_capacity(bytes.len());
    for k in 0..count {
        out.extend((0..element).map(|byte| bytes[byte * count + k]));
    }
    out.extend(&bytes[whole..]);
    out
}

/// The bytes before their check sum of Fletcher, if it is theirs.
fn checked(mut bytes: Vec<u8>) -> Read<Vec<u8>> {
    let Some(split) = bytes.len().checked_sub(4) else {
        return broken("a chunk is shorter than its check sum");
    };
    let stored = Fields::new(&bytes[split..], false).u32()?;
    bytes.truncate(split);
    let (mut low, mut high) = (0_u32, 0_u32);
    for pair in bytes.chunks(2) {
        let word = u32::from(pair[0]) << 8 | pair.get(1).map_or(0, |byte| u32::from(*byte));
        low = (low + word) % 65_535;
        high = (high + low) % 65_535;
    }
    // zero and the largest number are the same in these sums
    let same = |a: u32, b: u32| a % 65_535 == b % 65_535;
    if !same(stored >> 16, high) || !same(stored & 0xffff, low) {
        return broken("the check sum of a chunk differs");
    }
    Ok(bytes)
}

/// What LZF compressed to these bytes, at most `size` of them.
fn unpacked(bytes: &[u8], size: usize) -> Read<Vec<u8>> {
    let mut fields = Fields::new(bytes, false);
    let mut out: Vec<u8> = Vec::new();
    while !fields.rest().is_empty() {
        let control = usize::from(fields.u8()?);
        if control < 32 {
            out.extend(fields.take(control + 1)?);
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(fields.u8()?);
            }
            let back = (control & 31) << 8 | usize::from(fields.u8()?);
            let Some(from) = out.len().checked_sub(back + 1) else {
                return broken("a chunk of LZF refers to bytes before it");
            };
            for k in from..from + length + 2 {
                out.push(out[k]);
            }
        }
        if out.len() > size {
            return broken("a chunk of LZF is longer than it should be");
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_bytes_come_back_with_the_rest_behind_the_elements() {
        assert_eq!(unshuffled(&[1, 3, 2, 4, 9], 2), [1, 2, 3, 4, 9]);
    }

    #[test]
    fn lzf_repeats_what_was_before_and_refuses_what_was_not() {
        // three letters, then six from three back
        let packed = [2, b'a', b'b', b'c', 4 << 5, 2];
        assert_eq!(unpacked(&packed, 9).unwrap(), b"abcabcabc");
        assert!(unpacked(&packed, 8).is_err());
        assert!(unpacked(&[0, b'a', 4 << 5, 2], 9).is_err());
    }
}
