//! HDF5 files, as h5py, MATLAB (`save -v7.3`) and the HDF5 library write them.

mod chunks;
mod filters;
mod groups;
mod heap;
mod kinds;
mod objects;

use std::collections::BTreeSet;

use self::kinds::Member;
use self::objects::{Object, Storage};
use crate::array::{Array, Container, Found, Remarks, require_few};
use crate::error::{Read, Why, broken, refused};
use crate::input::{Fields, Input};
use crate::number::Stored;

/// The first bytes of the format, at byte 0, 512, 1024, ...
pub(crate) const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";
/// The deepest nesting of groups.
const MAX_DEPTH: usize = 16;
/// The largest number of elements of a cell or a struct array of MATLAB whose contents are listed.
const MAX_ELEMENTS: u64 = 1000;
/// The largest number of bytes of a data set for each byte of the file: what was never written has
/// none, and zeros are compressed to a thousandth.
const MAX_EXPANSION: u64 = 1100;

/// The largest address and the largest size of a block: sums and small multiples of them are numbers too.
const MAX_ADDRESS: u64 = 1 << 56;
const MAX_BLOCK: u64 = 1 << 40;

/// The sizes by which a file refers to its parts, and where they count from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    pub(crate) offset: usize,
    pub(crate) length: usize,
    pub(crate) base: u64,
}

impl Sizes {
    /// The next address as a byte of the file; `None` if it is that of nothing.
    pub(crate) fn address(self, fields: &mut Fields<'_>) -> Read<Option<u64>> {
        let address = fields.uint(self.offset)?;
        let nothing = u64::MAX >> (64 - 8 * self.offset as u32);
        if address == nothing {
            return Ok(None);
        }
        match address
            .checked_add(self.base)
            .filter(|at| *at <= MAX_ADDRESS)
        {
            Some(at) => Ok(Some(at)),
            None => broken("an address is none"),
        }
    }

    pub(crate) fn size(self, fields: &mut Fields<'_>) -> Read<u64> {
        fields.uint(self.length)
    }
}

/// The superblock: how the file refers to its parts, and its root group.
struct Superblock {
    sizes: Sizes,
    root: u64,
}

/// Where the format begins; `None` if it does not.
pub(crate) fn begin(start: &[u8]) -> Option<u64> {
    [0_usize, 512]
        .into_iter()
        .find(|at| start.get(*at..).is_some_and(|rest| rest.starts_with(MAGIC)))
        .map(|at| at as u64)
}

impl Superblock {
    fn read(input: &mut Input, base: u64) -> Read<Self> {
        let bytes = input.up_to(base, 128)?;
        let mut fields = Fields::new(&bytes, false);
        fields.skip(MAGIC.len())?;
        let version = fields.u8()?;
        let old = version < 2;
        if version > 3 {
            return refused(format!(
                "its HDF5 has a superblock of version {version}: convert it by `h5repack --low=0 --high=2`"
            ));
        }
        if old {
            fields.skip(4)?;
        }
        let (offset, length) = (usize::from(fields.u8()?), usize::from(fields.u8()?));
        if ![2, 4, 8].contains(&offset) || ![2, 4, 8].contains(&length) {
            return broken(format!(
                "its addresses have {offset} bytes and its lengths {length}"
            ));
        }
        let sizes = Sizes {
            offset,
            length,
            base,
        };
        if old {
            fields.skip(if version == 0 { 9 } else { 13 })?;
            fields.skip(4 * offset)?;
            // the entry of the root group: the name, then the header
            fields.skip(offset)?;
        } else {
            fields.skip(1)?;
            fields.skip(3 * offset)?;
        }
        match sizes.address(&mut fields)? {
            Some(root) => Ok(Self { sizes, root }),
            None => broken("it has no root group"),
        }
    }
}

/// The numbers of one array.
#[derive(Clone, Debug)]
struct Place {
    storage: Storage,
    /// The sizes of the data set's axes.
    shape: Vec<u64>,
    /// The size of an element of it.
    element: usize,
    /// Where the numbers are in an element, and how many.
    offset: usize,
    count: u64,
    stored: Stored,
}

#[derive(Debug)]
struct Hdf5 {
    sizes: Sizes,
    places: Vec<Place>,
}

impl Container for Hdf5 {
    fn numbers(&self, input: &mut Input, place: usize) -> Read<Vec<f64>> {
        let Some(own) = self.places.get(place) else {
            return refused("it has disappeared");
        };
        let bytes = own
            .storage
            .data(input, self.sizes, &own.shape, own.element)?;
        let count = own.count as usize;
        let inside = bytes.chunks_exact(own.element.max(1)).flat_map(|element| {
            let own_bytes = element.get(own.offset..).unwrap_or_default();
            own_bytes.chunks_exact(own.stored.size).take(count)
        });
        Ok(inside.map(|bytes| own.stored.number(bytes)).collect())
    }
}

/// The arrays of a file while it is read.
struct Walk<'a> {
    input: &'a mut Input,
    sizes: Sizes,
    is_matlab: bool,
    /// The objects on the way to the present one: a link to one of them has no end.
    above: BTreeSet<u64>,
    /// How many objects were read.
    read: usize,
    arrays: Vec<Array>,
    places: Vec<Place>,
    unread: Vec<(String, String)>,
    remarks: Remarks,
}

impl Walk<'_> {
    fn leave(&mut self, path: &str, why: impl Into<String>) -> Read<()> {
        self.unread.push((path.to_owned(), why.into()));
        require_few(self.unread.len())
    }

    /// Lists what is at an address.
    ///
    /// - `parent`: the path of the group that it is in, for fields of struct arrays.
    fn object(&mut self, at: u64, path: &str, parent: &str) -> Read<()> {
        if self.above.len() >= MAX_DEPTH || self.above.contains(&at) {
            return self.leave(path, "its groups are in each other without end");
        }
        self.read += 1;
        require_few(self.read / 4)?;
        let object = match Object::read(self.input, self.sizes, at) {
            Err(Why::Refused(why)) => return self.leave(path, why),
            other => other?,
        };
        for name in &object.attributes {
            self.remarks.add("an attribute", name, path);
        }
        self.above.insert(at);
        let found = match &object.storage {
            None if self.is_matlab && object.is_sparse => {
                self.leave(path, "it is a sparse matrix: save `full` of it")
            }
            Some(_) => self.data_set(&object, path, parent),
            None => self.group(&object, path),
        };
        self.above.remove(&at);
        found
    }

    fn group(&mut self, object: &Object, path: &str) -> Read<()> {
        let links = match groups::links(self.input, self.sizes, object) {
            Err(Why::Refused(why)) => return self.leave(path, why),
            other => other?,
        };
        for (name, at) in links {
            // what cells refer to, and objects of MATLAB
            if self.is_matlab && path.is_empty() && matches!(&*name, "#refs#" | "#subsystem#") {
                continue;
            }
            let separator = match (path, self.is_matlab) {
                ("", _) => "",
                (_, true) => ".",
                (_, false) => "/",
            };
            let own = format!("{path}{separator}{name}");
            match at {
                Some(at) => self.object(at, &own, path)?,
                None => self.leave(&own, "it is a link to another place: copy what it links to")?,
            }
        }
        Ok(())
    }

    fn data_set(&mut self, object: &Object, path: &str, parent: &str) -> Read<()> {
        let (Some(storage), Some(kind)) = (&object.storage, &object.kind) else {
            return self.leave(path, "its type is missing");
        };
        let Some(shape) = &object.shape else {
            return self.leave(path, "it is empty");
        };
        let is_scale = |name: &&String| matches!(name.as_str(), "scale_factor" | "add_offset");
        if let Some(own) = object.attributes.iter().find(is_scale) {
            let why = format!(
                "it has packed values, and their {own} is not applied here: save the numbers themselves"
            );
            return self.leave(path, why);
        }
        if self.is_matlab {
            match object.class.as_str() {
                "" | "double" | "single" | "logical" | "cell" => {}
                "char" => return self.leave(path, "it has text"),
                "function_handle" => return self.leave(path, "it is a function"),
                class if class.starts_with("int") || class.starts_with("uint") => {}
                class => {
                    return self.leave(
                        path,
                        format!(
                            "it is an object of MATLAB ({class}): save its numbers as plain arrays, such as \
                             `q = out.q.Data; t = out.q.Time`"
                        ),
                    );
                }
            }
            if object.is_empty {
                return self.leave(path, "it is empty");
            }
        }
        if let Err(Why::Refused(why)) = storage.check() {
            return self.leave(path, why);
        }
        let mut bytes = shape.iter().copied().chain([kind.size as u64]);
        let bytes = bytes.try_fold(1_u64, u64::checked_mul);
        let limit = self.input.len().saturating_mul(MAX_EXPANSION);
        if bytes.is_none_or(|bytes| bytes > limit) {
            let sizes: Vec<String> = shape.iter().map(u64::to_string).collect();
            return self.leave(
                path,
                format!(
                    "it claims {} numbers, more than a file of {} bytes can have",
                    sizes.join(" x "),
                    self.input.len()
                ),
            );
        }
        if kind.is_reference {
            return self.references(storage, shape, kind.size, path, parent, &object.class);
        }
        if kind.members.is_empty() {
            return self.leave(path, kind.why);
        }
        for Member {
            name,
            offset,
            axes,
            stored,
            states,
        } in &kind.members
        {
            let own = match (name.as_str(), self.is_matlab) {
                ("", _) => path.to_owned(),
                (name, _) => format!("{path}.{name}"),
            };
            let Some(stored) = *stored else {
                self.leave(&own, "it has no numbers")?;
                continue;
            };
            self.remarks.add_states(states, &own);
            // MATLAB names the sizes in the other order
            let mut whole: Vec<u64> = shape.iter().chain(axes).copied().collect();
            if self.is_matlab {
                whole.reverse();
            }
            self.arrays.push(Array {
                columns_first: self.is_matlab,
                place: self.places.len(),
                unit: object.unit.clone(),
                ..Array::new(own, whole)
            });
            self.places.push(Place {
                storage: storage.clone(),
                shape: shape.clone(),
                element: kind.size,
                offset: *offset,
                count: axes.iter().product(),
                stored,
            });
            require_few(self.places.len())?;
        }
        Ok(())
    }

    /// Lists what a cell, or the field of a struct array, refers to.
    fn references(
        &mut self,
        storage: &Storage,
        shape: &[u64],
        size: usize,
        path: &str,
        parent: &str,
        class: &str,
    ) -> Read<()> {
        let count: u64 = shape.iter().product();
        if !self.is_matlab {
            return self.leave(path, "it has references, not numbers");
        }
        if count > MAX_ELEMENTS {
            return self.leave(
                path,
                format!("it has {count} cells or elements with fields"),
            );
        }
        let bytes = match storage.data(self.input, self.sizes, shape, size) {
            Err(Why::Refused(why)) => return self.leave(path, why),
            other => other?,
        };
        for (k, reference) in bytes.chunks_exact(size.max(1)).enumerate() {
            let mut fields = Fields::new(reference, false);
            let Some(at) = self.sizes.address(&mut fields)? else {
                continue;
            };
            let field = path.strip_prefix(parent).unwrap_or(path);
            let own = match class {
                "cell" => format!("{path}[{k}]"),
                _ => format!("{parent}[{k}]{field}"),
            };
            self.object(at, &own, path)?;
        }
        Ok(())
    }
}

/// Opens a file.
pub(crate) fn open(input: &mut Input, start: &[u8]) -> Read<Found> {
    let base = begin(start).unwrap_or(0);
    let Superblock { sizes, root } = Superblock::read(input, base)?;
    let mut walk = Walk {
        input,
        sizes,
        is_matlab: start.starts_with(b"MATLAB 7.3"),
        above: BTreeSet::new(),
        read: 0,
        arrays: Vec::new(),
        places: Vec::new(),
        unread: Vec::new(),
        remarks: Remarks::default(),
    };
    walk.object(root, "", "")?;
    let Walk {
        arrays,
        places,
        mut unread,
        remarks,
        ..
    } = walk;
    remarks.tell(&mut unread);
    Ok(Found {
        arrays,
        unread,
        container: Box::new(Hdf5 { sizes, places }),
    })
}
