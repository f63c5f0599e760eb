//! The chunks of data sets, and the indices in which they are found.

use super::Sizes;
use super::filters::{self, Filter};
use super::heap::{self, Tree};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input};

/// The deepest tree.
const MAX_LEVELS: u8 = 16;

/// Where the chunks of a data set are listed.
#[derive(Clone, Debug)]
pub(super) enum Index {
    /// Nothing was written.
    None,
    /// In a tree.
    Tree(u64),
    /// There is one, at an address, with the length and the mask of filters if it has some.
    Single(u64, Option<(u64, u32)>),
    /// One behind the other.
    InOrder(u64),
    /// In an array of addresses.
    Fixed(u64),
    /// In an array that grows.
    Growing(u64),
    /// In a tree of the second version.
    NewTree(u64),
}

/// A chunk in the file.
struct Found {
    /// Its first element along each axis.
    start: Vec<u64>,
    at: u64,
    length: u64,
    mask: u32,
}

impl Index {
    /// Takes the index of a layout of the fourth version.
    pub(super) fn read(fields: &mut Fields<'_>, sizes: Sizes, flags: u8) -> Read<Self> {
        let kind = fields.u8()?;
        let mut single = None;
        match kind {
            1 if flags & 2 != 0 => single = Some((sizes.size(fields)?, fields.u32()?)),
            1 | 2 => {}
            3 => fields.skip(1)?,
            4 => fields.skip(5)?,
            5 => fields.skip(6)?,
            _ => {
                return refused(
                    "its chunks have an unknown index: convert it by `h5repack --low=0 --high=2`",
                );
            }
        }
        let Some(at) = sizes.address(fields)? else {
            return Ok(Self::None);
        };
        Ok(match kind {
            1 => Self::Single(at, single),
            2 => Self::InOrder(at),
            3 => Self::Fixed(at),
            4 => Self::Growing(at),
            _ => Self::NewTree(at),
        })
    }
}

/// The elements of a data set in chunks.
///
/// - `(shape, element)`: the sizes of its axes, and that of an element.
pub(super) fn data(
    input: &mut Input,
    sizes: Sizes,
    (shape, element): (&[u64], usize),
    chunk: &[u64],
    index: &Index,
    filters: &[Filter],
) -> Read<Vec<u8>> {
    let all = |axes: &[u64]| {
        let mut bytes = axes.iter().copied().chain([element as u64]);
        bytes.try_fold(1_u64, u64::checked_mul)
    };
    let (Some(whole), Some(size)) = (all(shape), all(chunk)) else {
        return broken("a data set claims more bytes than there are addresses");
    };
    if chunk.contains(&0) || size == 0 {
        return broken("a chunk of a data set has no element");
    }
    // a chunk may be longer than the data set, which is limited by the length of the file
    let limit = whole.max(input.len().saturating_mul(super::MAX_EXPANSION));
    if size > limit {
        return broken("a chunk of a data set is larger than the file can have");
    }
    let mut out = vec![0; whole as usize];
    let found = listed(input, sizes, shape, chunk, index, !filters.is_empty(), size)?;
    // each chunk counts once, so that work is limited by the sizes of data set and file
    let count = number_of_chunks(shape, chunk);
    if found.len() as u64 > count {
        return broken("a data set lists more chunks than it has");
    }
    for own in found {
        let bytes = input.data(own.at, own.length)?;
        let bytes = filters::undo(filters, own.mask, bytes, size as usize)?;
        if (bytes.len() as u64) < size {
            return broken(format!(
                "a chunk of a data set has {} bytes in place of {size}",
                bytes.len()
            ));
        }
        place(&mut out, &bytes, (shape, element), chunk, &own.start)?;
    }
    Ok(out)
}

fn number_of_chunks(shape: &[u64], chunk: &[u64]) -> u64 {
    let along = shape.iter().zip(chunk).map(|(all, own)| all.div_ceil(*own));
    along.fold(1, u64::saturating_mul)
}

/// Copies the elements of a chunk to their places.
fn place(
    out: &mut [u8],
    bytes: &[u8],
    (shape, element): (&[u64], usize),
    chunk: &[u64],
    start: &[u64],
) -> Read<()> {
    let Some((last, outer)) = chunk.split_last() else {
        let count = element.min(bytes.len());
        out[..count].copy_from_slice(&bytes[..count]);
        return Ok(());
    };
    let axis = outer.len();
    if (0..chunk.len()).any(|k| start[k] >= shape[k]) {
        return broken("a chunk of a data set begins outside of it");
    }
    let run = (*last).min(shape[axis] - start[axis]) as usize * element;
    let lines: u64 = outer.iter().product();
    for line in 0..lines {
        // where this line of the chunk is along the other axes
        let (mut rest, mut inside, mut to) = (line, true, 0_u64);
        let mut stride = shape[axis];
        for k in (0..axis).rev() {
            let index = start[k] + rest % chunk[k];
            rest /= chunk[k];
            inside &= index < shape[k];
            to = to.wrapping_add(index.wrapping_mul(stride));
            stride = stride.wrapping_mul(shape[k]);
        }
        if !inside {
            continue;
        }
        let to = (to + start[axis]) as usize * element;
        let from = line as usize * *last as usize * element;
        match (out.get_mut(to..to + run), bytes.get(from..from + run)) {
            (Some(own), Some(line)) => own.copy_from_slice(line),
            _ => return broken("a chunk of a data set is not within it"),
        }
    }
    Ok(())
}

/// The first element of the chunk with a number, in the order of the last axis first.
fn start_of(number: u64, shape: &[u64], chunk: &[u64]) -> Vec<u64> {
    let mut rest = number;
    let mut out = vec![0; shape.len()];
    for axis in (0..shape.len()).rev() {
        let count = shape[axis].div_ceil(chunk[axis]).max(1);
        out[axis] = rest % count * chunk[axis];
        rest /= count;
    }
    out
}

/// The chunks that are in the file.
///
/// - `size`: that of a whole chunk.
fn listed(
    input: &mut Input,
    sizes: Sizes,
    shape: &[u64],
    chunk: &[u64],
    index: &Index,
    is_filtered: bool,
    size: u64,
) -> Read<Vec<Found>> {
    let mut out = Vec::new();
    let count = number_of_chunks(shape, chunk);
    match index {
        Index::None => {}
        Index::Tree(at) => tree(input, sizes, *at, chunk.len(), MAX_LEVELS, &mut out)?,
        Index::Single(at, filtered) => {
            let (length, mask) = filtered.unwrap_or((size, 0));
            out.push(Found {
                start: vec![0; shape.len()],
                at: *at,
                length,
                mask,
            });
        }
        Index::InOrder(at) => {
            if count.checked_mul(size).is_none_or(|all| all > input.len()) {
                return broken("its chunks are longer than the file");
            }
            out.extend((0..count).map(|number| Found {
                start: start_of(number, shape, chunk),
                at: at + number * size,
                length: size,
                mask: 0,
            }));
        }
        Index::Fixed(at) | Index::Growing(at) => {
            let entries = if matches!(index, Index::Fixed(_)) {
                heap::fixed_array(input, sizes, *at)?
            } else {
                heap::growing_array(input, sizes, *at, count)?
            };
            for (number, entry) in entries.iter().enumerate().take(count as usize) {
                let mut fields = Fields::new(entry, false);
                let Some(at) = sizes.address(&mut fields)? else {
                    continue;
                };
                let (length, mask) = if is_filtered {
                    let width = fields.rest().len().saturating_sub(4);
                    (fields.uint(width.min(8))?, fields.u32()?)
                } else {
                    (size, 0)
                };
                out.push(Found {
                    start: start_of(number as u64, shape, chunk),
                    at,
                    length,
                    mask,
                });
            }
        }
        Index::NewTree(at) => {
            let Tree { kind, records } = heap::tree(input, sizes, *at)?;
            for record in records {
                let mut fields = Fields::new(&record, false);
                let Some(at) = sizes.address(&mut fields)? else {
                    continue;
                };
                let starts = 8 * chunk.len();
                let (length, mask) = if kind == 11 {
                    let width = fields.rest().len().saturating_sub(4 + starts);
                    (fields.uint(width.min(8))?, fields.u32()?)
                } else {
                    (size, 0)
                };
                let mut start = Vec::new();
                for own in chunk {
                    start.push(fields.u64()?.saturating_mul(*own));
                }
                out.push(Found {
                    start,
                    at,
                    length,
                    mask,
                });
            }
        }
    }
    Ok(out)
}

/// Lists the chunks below a node of a tree.
fn tree(
    input: &mut Input,
    sizes: Sizes,
    at: u64,
    rank: usize,
    levels: u8,
    out: &mut Vec<Found>,
) -> Read<()> {
    let head = input.bytes(at, 8)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"TREE" || fields.u8()? != 1 || levels == 0 {
        return broken(format!("there is no tree of chunks at byte {at}"));
    }
    let level = fields.u8()?;
    let count = u64::from(fields.u16()?);
    let entry = 8 + 8 * (rank as u64 + 1) + sizes.offset as u64;
    let bytes = input.bytes(at + 8 + 2 * sizes.offset as u64, count * entry)?;
    let mut fields = Fields::new(&bytes, false);
    for _ in 0..count {
        let (length, mask) = (u64::from(fields.u32()?), fields.u32()?);
        let mut start = Vec::new();
        for _ in 0..rank {
            start.push(fields.u64()?);
        }
        fields.skip(8)?;
        let Some(child) = sizes.address(&mut fields)? else {
            continue;
        };
        if level > 0 {
            tree(input, sizes, child, rank, levels - 1, out)?;
        } else {
            out.push(Found {
                start,
                at: child,
                length,
                mask,
            });
        }
    }
    Ok(())
}
