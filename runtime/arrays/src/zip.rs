//! The entries of a ZIP archive, as NumPy writes them: stored or deflated.

use std::io::{self, Read as _};

use flate2::Crc;
use flate2::read::DeflateDecoder;

use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, exactly, text};

/// The first bytes of an archive with entries.
pub(crate) const MAGIC: &[u8] = b"PK\x03\x04";
/// The length of the record at the end of an archive, without its comment.
const END_BYTES: u64 = 22;
/// The longest comment.
const MAX_COMMENT: u64 = 65_535;

/// An entry.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) name: String,
    deflated: bool,
    check: u32,
    packed: u64,
    /// The length of its content.
    pub(crate) size: u64,
    /// Where its header begins.
    at: u64,
}

/// Passed-over kinds of archives, by a part of the name of an entry, with what to do with them.
const OTHERS: [(&str, &str); 3] = [
    (
        "xl/",
        "this is a workbook of a spreadsheet: save the sheet with the log as CSV",
    ),
    (
        "simulink/",
        "this is a model of Simulink, not a log: save what it logs by `save('log.mat', 'out')`",
    ),
    (
        "content.xml",
        "this is a document of an office program: save the sheet with the log as CSV",
    ),
];

/// The entries of an archive.
pub(crate) fn entries(input: &mut Input) -> Read<Vec<Entry>> {
    let from = input.len().saturating_sub(END_BYTES + MAX_COMMENT);
    let tail = input.up_to(from, END_BYTES + MAX_COMMENT)?;
    let Some(end) = tail.windows(4).rposition(|four| four == b"PK\x05\x06") else {
        return broken("this ZIP archive is cut off: it has no list of entries");
    };
    let mut fields = Fields::new(&tail[end..], false);
    fields.skip(10)?;
    let (mut count, mut size) = (u64::from(fields.u16()?), u64::from(fields.u32()?));
    let mut at = u64::from(fields.u32()?);
    if let Some(before) = end.checked_sub(20)
        && tail[before..].starts_with(b"PK\x06\x07")
    {
        let mut fields = Fields::new(&tail[before + 8..], false);
        let long_end = input.bytes(fields.u64()?, 56)?;
        let mut fields = Fields::new(&long_end, false);
        fields.skip(32)?;
        (count, size, at) = (fields.u64()?, fields.u64()?, fields.u64()?);
    }
    let list = input.bytes(at, size)?;
    let mut fields = Fields::new(&list, false);
    let mut out = Vec::new();
    for _ in 0..count {
        if fields.take(4)? != b"PK\x01\x02" {
            return broken("its list of entries has something else");
        }
        fields.skip(4)?;
        let flags = fields.u16()?;
        let method = fields.u16()?;
        fields.skip(4)?;
        let check = fields.u32()?;
        let (mut packed, mut size) = (u64::from(fields.u32()?), u64::from(fields.u32()?));
        let lengths = [fields.u16()?, fields.u16()?, fields.u16()?];
        fields.skip(8)?;
        let mut at = u64::from(fields.u32()?);
        let name = text(fields.take(usize::from(lengths[0]))?);
        let mut more = Fields::new(fields.take(usize::from(lengths[1]))?, false);
        fields.skip(usize::from(lengths[2]))?;
        while more.rest().len() >= 4 {
            let (kind, length) = (more.u16()?, more.u16()?);
            let mut own = Fields::new(more.take(usize::from(length))?, false);
            if kind != 1 {
                continue;
            }
            // the long numbers that do not fit into 32 bits
            for value in [&mut size, &mut packed, &mut at] {
                if *value == u64::from(u32::MAX) {
                    *value = own.u64()?;
                }
            }
        }
        if let Some((_, why)) = OTHERS.iter().find(|(part, _)| name.starts_with(part)) {
            return refused(*why);
        }
        if flags & 1 != 0 {
            return refused(format!("its entry {name} is encrypted"));
        }
        if !matches!(method, 0 | 8) {
            return refused(format!(
                "its entry {name} is compressed by method {method}: save it by `numpy.savez_compressed`"
            ));
        }
        out.push(Entry {
            name,
            deflated: method == 8,
            check,
            packed,
            size,
            at,
        });
    }
    Ok(out)
}

impl Entry {
    /// The content from its start.
    pub(crate) fn stream<'a>(&self, input: &'a mut Input) -> Read<Box<dyn io::Read + 'a>> {
        let header = input.bytes(self.at, 30)?;
        let mut fields = Fields::new(&header, false);
        if fields.take(4)? != MAGIC {
            return broken(format!("its entry {} is not where it should be", self.name));
        }
        fields.skip(22)?;
        let behind = u64::from(fields.u16()?) + u64::from(fields.u16()?);
        let packed = input.stream(self.at.saturating_add(30 + behind), self.packed)?;
        Ok(if self.deflated {
            Box::new(DeflateDecoder::new(packed))
        } else {
            Box::new(packed)
        })
    }

    /// The whole content, if its check sum is that of the archive.
    pub(crate) fn content(&self, input: &mut Input) -> Read<Vec<u8>> {
        let mut stream = self.stream(input)?;
        let bytes = exactly(&mut stream, self.size)?;
        let mut crc = Crc::new();
        crc.update(&bytes);
        if crc.sum() != self.check || stream.read(&mut [0])? > 0 {
            return broken(format!("the check sum of its entry {} differs", self.name));
        }
        Ok(bytes)
    }
}
