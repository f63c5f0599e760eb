//! Types of the elements of data sets.

use crate::error::{Read, broken};
use crate::input::{Fields, text};
use crate::number::{Kind as Number, Stored};

/// The deepest nesting of types.
const MAX_DEPTH: usize = 8;
/// The largest number of members.
const MAX_MEMBERS: usize = 1000;

/// Numbers in each element.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Member {
    /// Its path in a compound; empty for plain numbers.
    pub(super) name: String,
    pub(super) offset: usize,
    /// The sizes of its own axes.
    pub(super) axes: Vec<u64>,
    /// How its numbers are stored; `None` for what is no number.
    pub(super) stored: Option<Stored>,
    /// The numbers that have names, in their order in the file.
    pub(super) states: Vec<(f64, String)>,
}

/// A type.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Kind {
    /// The size of an element.
    pub(super) size: usize,
    pub(super) members: Vec<Member>,
    /// Whether elements refer to other objects.
    pub(super) is_reference: bool,
    /// Why it has no members.
    pub(super) why: &'static str,
}

impl Kind {
    fn without(size: usize, why: &'static str) -> Self {
        Self {
            size,
            members: Vec::new(),
            is_reference: false,
            why,
        }
    }

    fn plain(size: usize, stored: Option<Stored>) -> Self {
        let one = Member {
            name: String::new(),
            offset: 0,
            axes: Vec::new(),
            stored,
            states: Vec::new(),
        };
        Self {
            members: stored.map(|_| one).into_iter().collect(),
            ..Self::without(size, "its numbers have an unusual size")
        }
    }

    /// Takes a type from the fields that describe it.
    pub(super) fn read(fields: &mut Fields<'_>, depth: usize) -> Read<Self> {
        if depth > MAX_DEPTH {
            return broken("its types are in each other without end");
        }
        let head = fields.u8()?;
        let (class, version) = (head & 15, head >> 4);
        let bits = fields.uint(3)?;
        let size = fields.u32()? as usize;
        let big = bits & 1 != 0;
        Ok(match class {
            0 | 4 => {
                let shift = fields.u16()?;
                let precision = usize::from(fields.u16()?);
                let signed = class == 0 && bits & 8 != 0;
                let kind = if signed {
                    Number::Signed
                } else {
                    Number::Unsigned
                };
                let whole = shift == 0 && precision == 8 * size;
                Self::plain(size, Stored::new(kind, size, big).filter(|_| whole))
            }
            1 => {
                fields.skip(2)?;
                let precision = usize::from(fields.u16()?);
                // exponents and mantissas of other sizes than those of IEEE are of other machines
                let exponent = (fields.u8()?, fields.u8()?);
                fields.skip(6)?;
                let usual = matches!(
                    (size, exponent),
                    (2, (10, 5)) | (4, (23, 8)) | (8, (52, 11))
                );
                let whole = usual && precision == 8 * size && bits & 0x40 == 0;
                Self::plain(
                    size,
                    Stored::new(Number::Float, size, big).filter(|_| whole),
                )
            }
            2 => {
                fields.skip(2)?;
                Self::without(size, "it has times of an old kind")
            }
            3 => Self::without(size, "it has text"),
            5 => {
                // the name of the kind
                fields.skip((bits & 255) as usize)?;
                Self::without(size, "it has bytes without a type")
            }
            6 => Self::compound(fields, version, bits, size, depth)?,
            7 => Self {
                is_reference: size >= 2 && bits.trailing_zeros() >= 4,
                ..Self::without(size, "it has references")
            },
            8 => {
                let mut base = Self::read(fields, depth + 1)?;
                let count = (bits & 0xffff) as usize;
                let mut names = Vec::new();
                for _ in 0..count {
                    names.push(name(fields, version)?);
                }
                let numbers = fields.take(count.saturating_mul(base.size))?;
                if let [
                    Member {
                        stored: Some(stored),
                        states,
                        ..
                    },
                ] = &mut base.members[..]
                {
                    let numbers = numbers.chunks_exact(base.size.max(1));
                    let numbers = numbers.map(|bytes| stored.number(bytes));
                    *states = numbers.zip(names).collect();
                    // what h5py makes of truths
                    if matches!(&states[..], [(_, no), (_, yes)] if no == "FALSE" && yes == "TRUE")
                    {
                        states.clear();
                    }
                }
                base
            }
            9 => {
                Self::read(fields, depth + 1)?;
                Self::without(size, "it has text, or lists of different lengths")
            }
            10 => {
                let rank = fields.u8()?;
                if version < 3 {
                    fields.skip(3)?;
                }
                let mut axes = Vec::new();
                for _ in 0..rank {
                    axes.push(u64::from(fields.u32()?));
                }
                if version < 3 {
                    fields.skip(4 * usize::from(rank))?;
                }
                let base = Self::read(fields, depth + 1)?;
                match &base.members[..] {
                    [one] if one.name.is_empty() && one.axes.is_empty() => Self {
                        size,
                        members: vec![Member {
                            axes,
                            ..one.clone()
                        }],
                        ..base
                    },
                    _ => Self::without(size, "it has arrays of records"),
                }
            }
            _ => Self::without(size, "its type is unknown"),
        })
    }

    fn compound(
        fields: &mut Fields<'_>,
        version: u8,
        bits: u64,
        size: usize,
        depth: usize,
    ) -> Read<Self> {
        let count = (bits & 0xffff) as usize;
        let mut members = Vec::new();
        for _ in 0..count {
            let own = name(fields, version)?;
            let offset = match version {
                3.. => {
                    let width = (usize::BITS - size.leading_zeros()).div_ceil(8).max(1);
                    fields.uint(width as usize)?
                }
                _ => u64::from(fields.u32()?),
            } as usize;
            let mut axes = Vec::new();
            if version == 1 {
                let rank = usize::from(fields.u8()?);
                fields.skip(11)?;
                for axis in 0..4 {
                    let length = u64::from(fields.u32()?);
                    if axis < rank {
                        axes.push(length);
                    }
                }
            }
            let kind = Self::read(fields, depth + 1)?;
            let path = |inner: &str| match inner {
                "" => own.clone(),
                inner => format!("{own}.{inner}"),
            };
            if kind.members.is_empty() || !axes.is_empty() && kind.members.len() > 1 {
                members.push(Member {
                    name: own.clone(),
                    offset,
                    axes: Vec::new(),
                    stored: None,
                    states: Vec::new(),
                });
            } else {
                members.extend(kind.members.iter().map(|inner| Member {
                    name: path(&inner.name),
                    offset: offset.saturating_add(inner.offset),
                    axes: axes.iter().chain(&inner.axes).copied().collect(),
                    stored: inner.stored,
                    states: inner.states.clone(),
                }));
            }
            if members.len() > MAX_MEMBERS {
                return broken(format!("a type has more than {MAX_MEMBERS} members"));
            }
        }
        for member in &members {
            let bytes = member.stored.map_or(0, |stored| stored.size as u64);
            let bytes = member
                .axes
                .iter()
                .try_fold(bytes, |all, n| all.checked_mul(*n));
            let end = bytes.and_then(|bytes| bytes.checked_add(member.offset as u64));
            if end.is_none_or(|end| end > size as u64) {
                return broken("a member of a type is not within it");
            }
        }
        Ok(Self {
            members,
            ..Self::without(size, "it has no members")
        })
    }
}

/// The name of a member, which is filled up to a multiple of 8 in early versions.
fn name(fields: &mut Fields<'_>, version: u8) -> Read<String> {
    let Some(end) = fields.rest().iter().position(|byte| *byte == 0) else {
        return broken("the name of a member has no end");
    };
    let length = if version < 3 {
        (end + 1).next_multiple_of(8)
    } else {
        end + 1
    };
    Ok(text(fields.take(length)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enumeration_has_the_names_of_its_numbers_but_truths_need_none() {
        let of = |names: &[u8]| {
            // two names of whole numbers of two bytes with a sign
            let head = [
                0x38, 2, 0, 0, 2, 0, 0, 0, 0x10, 8, 0, 0, 2, 0, 0, 0, 0, 0, 16, 0,
            ];
            let bytes = [&head[..], names, &[0xff, 0xff, 1, 0]].concat();
            let kind = Kind::read(&mut Fields::new(&bytes, false), 0).ok()?;
            kind.members.first().map(|own| own.states.clone())
        };
        let expected = [(-1.0, "off".to_owned()), (1.0, "on".to_owned())];
        assert_eq!(of(b"off\0on\0").as_deref(), Some(&expected[..]));
        assert_eq!(of(b"FALSE\0TRUE\0"), Some(Vec::new()));
    }
}
