//! The headers of objects: what each message of one says.

use super::Sizes;
use super::chunks::{self, Index};
use super::filters::{self, Filter};
use super::heap;
use super::kinds::Kind;
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, text};

/// The largest number of parts of a header.
const MAX_PARTS: usize = 1000;

/// Where the numbers of a data set are.
#[derive(Clone, Debug)]
pub(super) enum Storage {
    /// In the header.
    Here(Vec<u8>),
    /// In one piece; nowhere if nothing was written.
    Piece(Option<u64>, u64),
    Chunks {
        /// The sizes of a chunk's axes.
        chunk: Vec<u64>,
        index: Index,
        filters: Vec<Filter>,
    },
    /// Elsewhere, with a sentence.
    Elsewhere(&'static str),
}

impl Storage {
    /// Refuses what is not read.
    pub(super) fn check(&self) -> Read<()> {
        match self {
            Self::Elsewhere(why) => refused(*why),
            Self::Chunks { filters, .. } => filters.iter().try_for_each(Filter::check),
            _ => Ok(()),
        }
    }

    /// The bytes of all elements.
    pub(super) fn data(
        &self,
        input: &mut Input,
        sizes: Sizes,
        shape: &[u64],
        element: usize,
    ) -> Read<Vec<u8>> {
        let mut all = shape.iter().copied().chain([element as u64]);
        let Some(bytes) = all.try_fold(1_u64, u64::checked_mul) else {
            return broken("a data set claims more bytes than there are addresses");
        };
        match self {
            Self::Here(own) if own.len() as u64 >= bytes => Ok(own[..bytes as usize].to_vec()),
            Self::Here(_) => broken("a data set in a header ends early"),
            // the limit of the data set was checked when it was listed
            Self::Piece(None, _) => Ok(vec![0; bytes as usize]),
            Self::Piece(Some(at), length) if *length >= bytes => input.data(*at, bytes),
            Self::Piece(..) => broken("a data set ends early"),
            Self::Chunks {
                chunk,
                index,
                filters,
            } => chunks::data(input, sizes, (shape, element), chunk, index, filters),
            Self::Elsewhere(why) => refused(*why),
        }
    }
}

/// How the links of a group are stored.
#[derive(Clone, Debug)]
pub(super) enum Links {
    /// In a tree of names and a heap.
    Table { tree: u64, heap: u64 },
    /// In a heap with a tree of their hashes.
    Dense { heap: u64, tree: u64 },
}

/// What the header of an object says.
#[derive(Clone, Debug, Default)]
pub(super) struct Object {
    /// The sizes of the axes of a data set; `None` if it has no element.
    pub(super) shape: Option<Vec<u64>>,
    pub(super) kind: Option<Kind>,
    pub(super) storage: Option<Storage>,
    /// Links in the header: names with addresses, or `None` for links to other places.
    pub(super) links: Vec<(String, Option<u64>)>,
    pub(super) more_links: Vec<Links>,
    /// The attribute `MATLAB_class`; empty without one.
    pub(super) class: String,
    /// Whether the attribute `MATLAB_sparse` is there, which makes a group the parts of a sparse matrix.
    pub(super) is_sparse: bool,
    /// Whether the attribute `MATLAB_empty` says so.
    pub(super) is_empty: bool,
    /// The text of the attribute `unit` or `units`; empty without one.
    pub(super) unit: String,
    /// The names of the other attributes.
    pub(super) attributes: Vec<String>,
    filters: Vec<Filter>,
}

/// A message: its type, its flags and its data.
struct Message {
    kind: u16,
    flags: u8,
    data: Vec<u8>,
}

/// The messages of the header at an address.
fn messages(input: &mut Input, sizes: Sizes, at: u64) -> Read<Vec<Message>> {
    let start = input.up_to(at, 64)?;
    let mut fields = Fields::new(&start, false);
    let is_new = start.starts_with(b"OHDR");
    let mut tracked = false;
    // parts of the header that are still to be read: address and length
    let mut parts = Vec::new();
    if is_new {
        fields.skip(5)?;
        let flags = fields.u8()?;
        tracked = flags & 4 != 0;
        fields.skip(if flags & 0x20 == 0 { 0 } else { 16 })?;
        fields.skip(if flags & 0x10 == 0 { 0 } else { 4 })?;
        let length = fields.uint(1 << (flags & 3))?;
        let head = (start.len() - fields.rest().len()) as u64;
        parts.push((at + head, length));
    } else {
        if start.first() != Some(&1) {
            return broken(format!("there is no object at byte {at}"));
        }
        fields.skip(8)?;
        let length = u64::from(fields.u32()?);
        parts.push((at + 16, length));
    }
    let mut out = Vec::new();
    let mut place = 0;
    while let Some((at, length)) = parts.get(place).copied() {
        place += 1;
        if place > MAX_PARTS {
            return broken("the header of an object has no end");
        }
        let bytes = input.bytes(at, length)?;
        let mut fields = Fields::new(&bytes, false);
        if is_new && place > 1 {
            if fields.take(4)? != b"OCHK" {
                return broken(format!("there is no part of a header at byte {at}"));
            }
            // the check sum
            fields = Fields::new(&bytes[4..bytes.len().max(8) - 4], false);
        }
        let least = match (is_new, tracked) {
            (false, _) => 8,
            (true, false) => 4,
            (true, true) => 6,
        };
        while fields.rest().len() >= least {
            let kind = if is_new {
                u16::from(fields.u8()?)
            } else {
                fields.u16()?
            };
            let length = usize::from(fields.u16()?);
            let flags = fields.u8()?;
            if !is_new {
                fields.skip(3)?;
            } else if tracked {
                fields.skip(2)?;
            }
            let data = fields.take(length)?;
            if kind == 0x10 {
                let mut own = Fields::new(data, false);
                if let Some(next) = sizes.address(&mut own)? {
                    parts.push((next, sizes.size(&mut own)?));
                }
                continue;
            }
            out.push(Message {
                kind,
                flags,
                data: data.to_vec(),
            });
        }
    }
    Ok(out)
}

impl Object {
    pub(super) fn read(input: &mut Input, sizes: Sizes, at: u64) -> Read<Self> {
        let mut out = Self::default();
        for message in messages(input, sizes, at)? {
            let mut fields = Fields::new(&message.data, false);
            match message.kind {
                0x01 => out.shape = shape(&mut fields, sizes)?,
                0x03 => out.kind = Some(kind(input, sizes, &message)?),
                0x08 => out.storage = Some(layout(&mut fields, sizes)?),
                0x0b => out.filters = filters::read(&mut fields)?,
                0x07 => out.storage = Some(Storage::Elsewhere("its numbers are in another file")),
                0x11 => {
                    let both = (sizes.address(&mut fields)?, sizes.address(&mut fields)?);
                    if let (Some(tree), Some(heap)) = both {
                        out.more_links.push(Links::Table { tree, heap });
                    }
                }
                0x02 => {
                    fields.skip(1)?;
                    let flags = fields.u8()?;
                    fields.skip(if flags & 1 == 0 { 0 } else { 8 })?;
                    let both = (sizes.address(&mut fields)?, sizes.address(&mut fields)?);
                    if let (Some(heap), Some(tree)) = both {
                        out.more_links.push(Links::Dense { heap, tree });
                    }
                }
                0x06 => out.links.push(link(&mut fields, sizes)?),
                0x0c => out.attribute(input, sizes, &mut fields)?,
                0x15 => {
                    fields.skip(1)?;
                    let flags = fields.u8()?;
                    fields.skip(if flags & 1 == 0 { 0 } else { 2 })?;
                    if sizes.address(&mut fields)?.is_some() {
                        out.attributes.push("(attributes in a heap)".to_owned());
                    }
                }
                _ => {}
            }
        }
        let element = out.kind.as_ref().map_or(0, |kind| kind.size);
        let rank = out.shape.as_ref().map_or(0, Vec::len);
        if let Some(Storage::Chunks { chunk, filters, .. }) = &mut out.storage {
            filters.clone_from(&out.filters);
            // the size of an element is behind those of the axes
            let last = chunk.pop();
            if chunk.len() != rank || last != Some(element as u64) && rank > 0 {
                return broken("the chunks of a data set have other axes than it");
            }
        }
        Ok(out)
    }

    /// Takes one of MATLAB's attributes, or a unit; of others the names.
    fn attribute(&mut self, input: &mut Input, sizes: Sizes, fields: &mut Fields<'_>) -> Read<()> {
        let version = fields.u8()?;
        let is_shared = fields.u8()? & 1 != 0 && version > 1;
        let lengths = [fields.u16()?, fields.u16()?, fields.u16()?];
        if version == 3 {
            fields.skip(1)?;
        }
        let padded = |length: u16| match version {
            1 => usize::from(length).next_multiple_of(8),
            _ => usize::from(length),
        };
        let name = text(fields.take(padded(lengths[0]))?);
        let is_unit = matches!(&*name.to_lowercase(), "unit" | "units");
        if !name.starts_with("MATLAB_") && !is_unit {
            if !is_of_writers(&name) {
                self.attributes.push(name);
            }
            return Ok(());
        }
        let class = fields
            .take(padded(lengths[1]))?
            .first()
            .map(|head| head & 15);
        fields.skip(padded(lengths[2]))?;
        if is_unit {
            self.unit = match class.filter(|_| !is_shared) {
                Some(3) => text(fields.rest()),
                Some(9) => heap::text(input, sizes, fields)?,
                _ => String::new(),
            };
            return Ok(());
        }
        match &*name {
            "MATLAB_class" => text(fields.rest()).trim_end().clone_into(&mut self.class),
            "MATLAB_empty" => self.is_empty = fields.rest().first().is_some_and(|own| *own != 0),
            "MATLAB_sparse" => self.is_sparse = true,
            _ => {}
        }
        Ok(())
    }
}

/// Whether an attribute is one that libraries write by themselves, for scales of axes and tables.
fn is_of_writers(name: &str) -> bool {
    const NAMES: [&str; 8] = [
        "CLASS",
        "NAME",
        "DIMENSION_LIST",
        "REFERENCE_LIST",
        "TITLE",
        "VERSION",
        "PYTABLES_FORMAT_VERSION",
        "H5PATH",
    ];
    NAMES.contains(&name) || name.starts_with("_N") || name.starts_with("FIELD_")
}

fn shape(fields: &mut Fields<'_>, sizes: Sizes) -> Read<Option<Vec<u64>>> {
    let (version, rank, _) = (fields.u8()?, fields.u8()?, fields.u8()?);
    // two is the kind of a space without elements
    let none = match version {
        1 => fields.skip(5).map(|()| false)?,
        _ => fields.u8()? == 2,
    };
    let mut out = Vec::new();
    for _ in 0..rank {
        out.push(sizes.size(fields)?);
    }
    Ok((!none).then_some(out))
}

/// The type of a data set, which may be that of an object of its own.
fn kind(input: &mut Input, sizes: Sizes, message: &Message) -> Read<Kind> {
    let mut fields = Fields::new(&message.data, false);
    if message.flags & 2 == 0 {
        return Kind::read(&mut fields, 0);
    }
    let version = fields.u8()?;
    let place = fields.u8()?;
    fields.skip(if version == 1 { 6 } else { 0 })?;
    if version == 3 && place != 2 {
        return refused("its type is in a heap of shared types");
    }
    let Some(at) = sizes.address(&mut fields)? else {
        return broken("a named type is nowhere");
    };
    for own in messages(input, sizes, at)? {
        if own.kind == 3 && own.flags & 2 == 0 {
            return Kind::read(&mut Fields::new(&own.data, false), 0);
        }
    }
    broken("a named type is none")
}

fn layout(fields: &mut Fields<'_>, sizes: Sizes) -> Read<Storage> {
    let version = fields.u8()?;
    if !matches!(version, 3..=5) {
        return Ok(Storage::Elsewhere(
            "its layout is of an early or a later version of HDF5: convert it by \
             `h5repack --low=0 --high=2`",
        ));
    }
    Ok(match fields.u8()? {
        0 => {
            let length = usize::from(fields.u16()?);
            Storage::Here(fields.take(length)?.to_vec())
        }
        1 => Storage::Piece(sizes.address(fields)?, sizes.size(fields)?),
        2 if version == 3 => {
            let rank = fields.u8()?;
            let tree = sizes.address(fields)?;
            let mut chunk = Vec::new();
            for _ in 0..rank {
                chunk.push(u64::from(fields.u32()?));
            }
            Storage::Chunks {
                chunk,
                index: tree.map_or(Index::None, Index::Tree),
                filters: Vec::new(),
            }
        }
        2 => {
            let flags = fields.u8()?;
            let (rank, width) = (fields.u8()?, usize::from(fields.u8()?));
            if width > 8 {
                return broken("the sizes of a chunk are longer than numbers");
            }
            let mut chunk = Vec::new();
            for _ in 0..rank {
                chunk.push(fields.uint(width)?);
            }
            let index = Index::read(fields, sizes, flags)?;
            Storage::Chunks {
                chunk,
                index,
                filters: Vec::new(),
            }
        }
        _ => Storage::Elsewhere("its numbers are in other data sets (a virtual one)"),
    })
}

/// A link in a header or a heap.
pub(super) fn link(fields: &mut Fields<'_>, sizes: Sizes) -> Read<(String, Option<u64>)> {
    fields.skip(1)?;
    let flags = fields.u8()?;
    let kind = if flags & 8 == 0 { 0 } else { fields.u8()? };
    fields.skip(if flags & 4 == 0 { 0 } else { 8 })?;
    fields.skip(usize::from(flags & 16 != 0))?;
    let length = fields.uint(1 << (flags & 3))? as usize;
    let name = text(fields.take(length)?);
    Ok((
        name,
        if kind == 0 {
            sizes.address(fields)?
        } else {
            None
        },
    ))
}
