//! The links of groups.

use super::Sizes;
use super::heap;
use super::objects::{Links, Object};
use crate::error::{Read, broken};
use crate::input::{Fields, Input, text};

/// The deepest tree.
const MAX_LEVELS: u8 = 16;

/// The names in a group, with the addresses of objects, or `None` for links to other places; sorted.
pub(super) fn links(
    input: &mut Input,
    sizes: Sizes,
    object: &Object,
) -> Read<Vec<(String, Option<u64>)>> {
    let mut out = object.links.clone();
    for links in &object.more_links {
        match links {
            Links::Table { tree, heap } => {
                let names = names(input, sizes, *heap)?;
                table(input, sizes, *tree, &names, MAX_LEVELS, &mut out)?;
            }
            Links::Dense { heap, tree } => heap::links(input, sizes, *heap, *tree, &mut out)?,
        }
    }
    out.sort();
    out.dedup();
    Ok(out)
}

/// The names of a group, in one text.
fn names(input: &mut Input, sizes: Sizes, at: u64) -> Read<Vec<u8>> {
    let head = input.up_to(at, 8 + 2 * sizes.length as u64 + sizes.offset as u64)?;
    let mut fields = Fields::new(&head, false);
    if fields.take(4)? != b"HEAP" {
        return broken(format!("there is no heap of names at byte {at}"));
    }
    fields.skip(4)?;
    let length = sizes.size(&mut fields)?;
    sizes.size(&mut fields)?;
    match sizes.address(&mut fields)? {
        Some(start) => input.bytes(start, length),
        None => Ok(Vec::new()),
    }
}

/// Adds the links below a node of a tree of names.
fn table(
    input: &mut Input,
    sizes: Sizes,
    at: u64,
    names: &[u8],
    levels: u8,
    out: &mut Vec<(String, Option<u64>)>,
) -> Read<()> {
    let head = input.bytes(at, 8)?;
    let mut fields = Fields::new(&head, false);
    let magic = fields.take(4)?;
    if levels == 0 {
        return broken("its trees of names have no end");
    }
    if magic == b"SNOD" {
        fields.skip(2)?;
        let count = u64::from(fields.u16()?);
        let entry = 2 * sizes.offset as u64 + 24;
        let bytes = input.bytes(at + 8, count * entry)?;
        for entry in bytes.chunks_exact(entry as usize) {
            let mut fields = Fields::new(entry, false);
            let name = fields.uint(sizes.offset)? as usize;
            let Some(name) = names.get(name..) else {
                return broken("a name is not in the heap of names");
            };
            let object = sizes.address(&mut fields)?;
            // 2 is a soft link
            let object = object.filter(|_| entry[2 * sizes.offset] != 2);
            out.push((text(name), object));
        }
        return Ok(());
    }
    if magic != b"TREE" {
        return broken(format!("there is no tree of names at byte {at}"));
    }
    fields.skip(2)?;
    let count = u64::from(fields.u16()?);
    let pair = (sizes.length + sizes.offset) as u64;
    let bytes = input.bytes(at + 8 + 2 * sizes.offset as u64, count * pair)?;
    let mut fields = Fields::new(&bytes, false);
    for _ in 0..count {
        sizes.size(&mut fields)?;
        if let Some(child) = sizes.address(&mut fields)? {
            table(input, sizes, child, names, levels - 1, out)?;
        }
    }
    Ok(())
}
