//! What later versions of the format keep lists in: trees of the second version, heaps of links, and
//! arrays of chunks; and the heaps of texts.

use super::objects::link;
use super::{MAX_BLOCK, Sizes};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input};

/// The deepest tree.
const MAX_LEVELS: u16 = 16;

/// The most bytes of a heap of texts that are read.
const MAX_TEXTS: u64 = 1 << 16;

/// The records of a tree of the second version.
pub(super) struct Tree {
    pub(super) kind: u8,
    pub(super) records: Vec<Vec<u8>>,
}

/// The number of bytes for numbers up to one.
fn width(largest: u64) -> usize {
    (64 - largest.leading_zeros()).div_ceil(8).max(1) as usize
}

/// What a tree's nodes have in common.
struct Nodes {
    node: u64,
    record: u64,
    /// For each level the largest number of records of a node, and that below it.
    most: Vec<(u64, u64)>,
}

/// Reads a tree.
pub(super) fn tree(input: &mut Input, sizes: Sizes, at: u64) -> Read<Tree> {
    let head = input.up_to(at, 64)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"BTHD" {
        return broken(format!("there is no tree at byte {at}"));
    }
    fields.skip(1)?;
    let kind = fields.u8()?;
    let (node, record) = (u64::from(fields.u32()?), u64::from(fields.u16()?));
    let depth = fields.u16()?;
    fields.skip(2)?;
    let root = sizes.address(&mut fields)?;
    let count = u64::from(fields.u16()?);
    if record == 0 || node < 16 || depth > MAX_LEVELS {
        return broken("a tree has nodes without records");
    }
    let leaf = (node - 10) / record;
    let mut most = vec![(leaf, leaf)];
    for level in 1..=usize::from(depth) {
        let (_, below) = most[level - 1];
        let pointer = pointer_bytes(sizes, &most, level);
        let own = (node - 10).saturating_sub(pointer) / (record + pointer);
        let all = own.saturating_add(own.saturating_add(1).saturating_mul(below));
        most.push((own, all));
    }
    let nodes = Nodes { node, record, most };
    let mut records = Vec::new();
    if let Some(root) = root {
        nodes.read(input, sizes, root, usize::from(depth), count, &mut records)?;
    }
    Ok(Tree { kind, records })
}

/// The bytes by which a node of a level refers to one below it.
fn pointer_bytes(sizes: Sizes, most: &[(u64, u64)], level: usize) -> u64 {
    let (records, all) = (most[0].0, most[level - 1].1);
    let total = if level > 1 { width(all) } else { 0 };
    (sizes.offset + width(records) + total) as u64
}

impl Nodes {
    fn read(
        &self,
        input: &mut Input,
        sizes: Sizes,
        at: u64,
        level: usize,
        count: u64,
        out: &mut Vec<Vec<u8>>,
    ) -> Read<()> {
        let bytes = input.bytes(at, self.node)?;
        let mut fields = Fields::new(&bytes, false);
        let magic: &[u8] = if level == 0 { b"BTLF" } else { b"BTIN" };
        if fields.take(4)? != magic {
            return broken(format!("there is no node of a tree at byte {at}"));
        }
        fields.skip(2)?;
        for _ in 0..count {
            out.push(fields.take(self.record as usize)?.to_vec());
        }
        if level == 0 {
            return Ok(());
        }
        // the number of records has as many bytes as that of a leaf
        let (records, all) = (self.most[0].0, self.most[level - 1].1);
        for _ in 0..=count {
            let child = sizes.address(&mut fields)?;
            let own = fields.uint(width(records))?;
            fields.skip(if level > 1 { width(all) } else { 0 })?;
            if let Some(child) = child {
                self.read(input, sizes, child, level - 1, own, out)?;
            }
        }
        Ok(())
    }
}

/// A heap of links.
struct Heap {
    table_width: u64,
    first_block: u64,
    largest_direct: u64,
    root: Option<u64>,
    /// The rows of the root, if it is a block of blocks.
    rows: u16,
    /// The bytes of an offset, and of a length, in the identifier of a link.
    offset: usize,
    length: usize,
}

/// Adds the links of a group in a heap.
pub(super) fn links(
    input: &mut Input,
    sizes: Sizes,
    heap: u64,
    names: u64,
    out: &mut Vec<(String, Option<u64>)>,
) -> Read<()> {
    let head = input.up_to(heap, 256)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"FRHP" {
        return broken(format!("there is no heap of links at byte {heap}"));
    }
    fields.skip(1)?;
    fields.skip(2)?;
    let filters = fields.u16()?;
    if filters > 0 {
        return refused("the names in it are compressed");
    }
    fields.skip(1)?;
    let largest_object = u64::from(fields.u32()?);
    fields.skip(2 * (sizes.offset + sizes.length))?;
    fields.skip(8 * sizes.length)?;
    let table_width = u64::from(fields.u16()?);
    let first_block = sizes.size(&mut fields)?;
    let largest_direct = sizes.size(&mut fields)?;
    let bits = u64::from(fields.u16()?);
    fields.skip(2)?;
    let root = sizes.address(&mut fields)?;
    let rows = fields.u16()?;
    let own = Heap {
        table_width,
        first_block,
        largest_direct,
        root,
        rows,
        offset: bits.div_ceil(8) as usize,
        length: width(largest_direct.min(largest_object)),
    };
    let sound = (1..=MAX_BLOCK).contains(&first_block) && largest_direct <= MAX_BLOCK;
    if table_width == 0 || !sound || own.offset > 8 {
        return broken("a heap of links has no blocks");
    }
    let Tree { kind, records } = tree(input, sizes, names)?;
    if kind != 5 {
        return broken("the names of a group are in a tree of something else");
    }
    for record in records {
        let mut fields = Fields::new(&record, false);
        fields.skip(4)?;
        let flags = fields.u8()?;
        if flags & 0x30 != 0 {
            out.push(("(a long name)".to_owned(), None));
            continue;
        }
        let at = fields.uint(own.offset)?;
        let length = fields.uint(own.length.min(8))?;
        let bytes = own.object(input, sizes, at, length)?;
        out.push(link(&mut Fields::new(&bytes, false), sizes)?);
    }
    Ok(())
}

impl Heap {
    /// The size of the blocks in a row of a block of blocks.
    fn row_size(&self, row: u32) -> u64 {
        match row.checked_sub(1) {
            None => self.first_block,
            Some(row) => self.first_block.checked_shl(row).unwrap_or(u64::MAX),
        }
    }

    /// The bytes of an object at an offset of the heap.
    fn object(&self, input: &mut Input, sizes: Sizes, offset: u64, length: u64) -> Read<Vec<u8>> {
        let Some(mut block) = self.root else {
            return broken("a heap of links is empty");
        };
        let (mut inside, mut rows) = (offset, u32::from(self.rows));
        // blocks of blocks are at most as deep as there are bits
        for _ in 0..64 {
            if rows == 0 {
                return input.bytes(block.saturating_add(inside), length);
            }
            let (mut row, mut start) = (0, 0_u64);
            loop {
                let bytes = self.row_size(row).saturating_mul(self.table_width);
                if inside < start.saturating_add(bytes) {
                    break;
                }
                start = start.saturating_add(bytes);
                row += 1;
                if row >= rows {
                    return broken("a link is not in its heap");
                }
            }
            let size = self.row_size(row);
            let column = (inside - start) / size;
            let entry = u64::from(row) * self.table_width + column;
            // the blocks are listed behind the heads of all blocks: magic, version, heap, offset
            let head = 5 + sizes.offset as u64 + self.offset as u64;
            let at = block.saturating_add(head + entry * sizes.offset as u64);
            let bytes = input.bytes(at, sizes.offset as u64)?;
            let Some(next) = sizes.address(&mut Fields::new(&bytes, false))? else {
                return broken("a block of a heap of links is missing");
            };
            block = next;
            inside = inside - start - column * size;
            rows = if size <= self.largest_direct {
                0
            } else {
                // a block of blocks has as many rows as make its size
                let first = (self.first_block * self.table_width).max(1);
                (size / first).checked_ilog2().unwrap_or(0) + 1
            };
        }
        broken("a heap of links has no end")
    }
}

/// A text of any length, which is in a heap; empty where it is not in the first [`MAX_TEXTS`] bytes of that.
///
/// - `fields`: its length, the address of the heap, and its number there.
pub(super) fn text(input: &mut Input, sizes: Sizes, fields: &mut Fields<'_>) -> Read<String> {
    let length = fields.u32()? as usize;
    let (at, number) = (sizes.address(fields)?, fields.u32()?);
    let Some(at) = at.filter(|_| length > 0) else {
        return Ok(String::new());
    };
    let head = input.bytes(at, 8 + sizes.length as u64)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"GCOL" {
        return broken(format!("there is no heap of texts at byte {at}"));
    }
    fields.skip(4)?;
    let size = sizes.size(&mut fields)?.min(MAX_TEXTS);
    // many attributes have their texts in one heap, so that this is read again and again
    let bytes = input.data(at, size)?;
    let mut fields = Fields::new(&bytes, false);
    fields.skip(head.len())?;
    while fields.rest().len() >= head.len() {
        let own = u32::from(fields.u16()?);
        fields.skip(6)?;
        let size = sizes.size(&mut fields)? as usize;
        // what has no number is the free rest
        if own == 0 {
            break;
        }
        let Ok(bytes) = fields.take(size) else {
            break;
        };
        if own == number {
            let bytes = bytes.get(..length).unwrap_or(bytes);
            return Ok(crate::input::text(bytes));
        }
        let fill = size.next_multiple_of(8) - size;
        fields.skip(fill.min(fields.rest().len()))?;
    }
    Ok(String::new())
}

/// The entries of an array of chunks that does not grow.
pub(super) fn fixed_array(input: &mut Input, sizes: Sizes, at: u64) -> Read<Vec<Vec<u8>>> {
    let head = input.up_to(at, 64)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"FAHD" {
        return broken(format!("there is no array of chunks at byte {at}"));
    }
    fields.skip(2)?;
    let entry = u64::from(fields.u8()?);
    let page_bits = u32::from(fields.u8()?);
    let count = sizes.size(&mut fields)?;
    let Some(block) = sizes.address(&mut fields)? else {
        return Ok(Vec::new());
    };
    if entry == 0 || page_bits > 32 || count > input.len() {
        return broken("an array of chunks has more entries than the file");
    }
    let mut start = block + 6 + sizes.offset as u64;
    let page = 1_u64 << page_bits;
    let mut out = Vec::new();
    if count <= page {
        let bytes = input.bytes(start, count * entry)?;
        out.extend(bytes.chunks_exact(entry as usize).map(<[u8]>::to_vec));
        return Ok(out);
    }
    // a bit for each page that is in use, a check sum, then the pages with one each
    let pages = count.div_ceil(page);
    let used = input.bytes(start, pages.div_ceil(8))?;
    start += pages.div_ceil(8) + 4;
    for number in 0..pages {
        let own = page.min(count - number * page);
        let bit = used[(number / 8) as usize] >> (7 - number % 8) & 1;
        if bit == 1 {
            let bytes = input.bytes(start, own * entry)?;
            out.extend(bytes.chunks_exact(entry as usize).map(<[u8]>::to_vec));
        } else {
            out.extend((0..own).map(|_| vec![0xff; entry as usize]));
        }
        start += page * entry + 4;
    }
    Ok(out)
}

/// The first entries of an array of chunks that grows.
pub(super) fn growing_array(
    input: &mut Input,
    sizes: Sizes,
    at: u64,
    wanted: u64,
) -> Read<Vec<Vec<u8>>> {
    let head = input.up_to(at, 128)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"EAHD" {
        return broken(format!("there is no growing array of chunks at byte {at}"));
    }
    fields.skip(2)?;
    let entry = u64::from(fields.u8()?);
    let most_bits = u32::from(fields.u8()?);
    let in_index = u64::from(fields.u8()?);
    let least = u64::from(fields.u8()?);
    let least_pointers = u64::from(fields.u8()?);
    let page_bits = u32::from(fields.u8()?);
    fields.skip(6 * sizes.length)?;
    let Some(index) = sizes.address(&mut fields)? else {
        return Ok(Vec::new());
    };
    let powers = least.is_power_of_two() && least_pointers.is_power_of_two();
    if entry == 0 || !powers || most_bits > 64 || page_bits > 32 || wanted > input.len() {
        return broken("a growing array of chunks has sizes that are none");
    }
    let offset_bytes = u64::from(most_bits.div_ceil(8));
    let mut out: Vec<Vec<u8>> = Vec::new();
    let take = |input: &mut Input, at: u64, count: u64, out: &mut Vec<Vec<u8>>| -> Read<()> {
        let bytes = input.bytes(at, count.saturating_mul(entry))?;
        out.extend(bytes.chunks_exact(entry as usize).map(<[u8]>::to_vec));
        Ok(())
    };
    let mut place = index + 6 + sizes.offset as u64;
    take(input, place, in_index, &mut out)?;
    place += in_index * entry;
    // blocks of entries double in size every second group of blocks: the first groups are listed in
    // the index, the others in blocks of addresses of their own
    let in_first = 2 * least_pointers.ilog2();
    let mut group = 0_u32;
    let mut list = place;
    while (out.len() as u64) < wanted {
        let blocks = 1_u64 << (group / 2).min(63);
        let size = least.saturating_mul(1_u64 << group.div_ceil(2).min(63));
        if group > most_bits {
            return broken("a growing array of chunks has no end");
        }
        let page = 1_u64 << page_bits;
        let pages = if size > page { size / page } else { 0 };
        let (mut at, mut init) = (list, None);
        if group >= in_first {
            let bytes = input.bytes(list, sizes.offset as u64)?;
            list += sizes.offset as u64;
            match sizes.address(&mut Fields::new(&bytes, false))? {
                None => {
                    skip_entries(&mut out, blocks.saturating_mul(size), wanted, entry);
                    group += 1;
                    continue;
                }
                Some(own) => {
                    let bits = own + 6 + sizes.offset as u64 + offset_bytes;
                    let bytes = pages.div_ceil(8).saturating_mul(blocks);
                    init = Some(bits);
                    at = bits.saturating_add(bytes);
                }
            }
        }
        for number in 0..blocks {
            if out.len() as u64 >= wanted {
                break;
            }
            let bytes = input.bytes(at + number * sizes.offset as u64, sizes.offset as u64)?;
            let Some(own) = sizes.address(&mut Fields::new(&bytes, false))? else {
                skip_entries(&mut out, size, wanted, entry);
                continue;
            };
            let mut from = own + 6 + sizes.offset as u64 + offset_bytes;
            if pages == 0 {
                take(input, from, size, &mut out)?;
                continue;
            }
            from += 4;
            for own_page in 0..pages {
                let bit = match init {
                    Some(bits) => {
                        let whole = bits + number * pages.div_ceil(8);
                        let byte = input.bytes(whole + own_page / 8, 1)?;
                        byte[0] >> (7 - own_page % 8) & 1
                    }
                    None => 1,
                };
                if bit == 1 {
                    take(input, from, page, &mut out)?;
                } else {
                    skip_entries(&mut out, page, wanted, entry);
                }
                from += page * entry + 4;
            }
        }
        if group < in_first {
            list += blocks * sizes.offset as u64;
        }
        group += 1;
    }
    Ok(out)
}

/// Adds entries of chunks that were never written, at most up to those that are wanted.
fn skip_entries(out: &mut Vec<Vec<u8>>, count: u64, wanted: u64, entry: u64) {
    let more = count.min(wanted.saturating_sub(out.len() as u64));
    out.extend((0..more).map(|_| vec![0xff; entry as usize]));
}
