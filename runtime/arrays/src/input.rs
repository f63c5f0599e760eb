//! Reads parts of a file, never more than it has, and never without end.

use std::fs::File;
use std::io::{self, Read as _, Seek, SeekFrom};
use std::path::Path;

use crate::error::{Read, Why, broken};

/// A file that is read at any place.
#[derive(Debug)]
pub(crate) struct Input {
    file: File,
    length: u64,
    /// The bytes that may still be read while its structure is read: structures that refer to the same
    /// places again and again end there.
    left: u64,
}

/// How often the bytes of a file may be read while its structure is read, and bytes on top of it.
const PASSES: u64 = 8;
const MORE_BYTES: u64 = 1 << 20;

impl Input {
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut out = Self {
            file,
            length,
            left: 0,
        };
        out.renew();
        Ok(out)
    }

    /// Lets the bytes of the file be read anew, for another array.
    pub(crate) fn renew(&mut self) {
        self.left = self
            .length
            .saturating_mul(PASSES)
            .saturating_add(MORE_BYTES);
    }

    pub(crate) fn len(&self) -> u64 {
        self.length
    }

    /// Refuses a part that is not within the file.
    fn check(&mut self, at: u64, count: u64) -> Read<()> {
        if at.checked_add(count).is_none_or(|end| end > self.length) {
            return broken(format!(
                "it refers to {count} bytes at byte {at}, and has {}",
                self.length
            ));
        }
        Ok(())
    }

    fn spend(&mut self, count: u64) -> Read<()> {
        match self.left.checked_sub(count) {
            Some(left) => self.left = left,
            None => return broken("its parts refer to the same bytes again and again"),
        }
        Ok(())
    }

    /// Some bytes of the structure of the file.
    pub(crate) fn bytes(&mut self, at: u64, count: u64) -> Read<Vec<u8>> {
        self.spend(count)?;
        self.data(at, count)
    }

    /// Some bytes of numbers, of which a file may have parts that are read again for each array.
    pub(crate) fn data(&mut self, at: u64, count: u64) -> Read<Vec<u8>> {
        self.check(at, count)?;
        self.file.seek(SeekFrom::Start(at))?;
        let mut out = vec![0; usize::try_from(count).unwrap_or(usize::MAX)];
        self.file.read_exact(&mut out)?;
        Ok(out)
    }

    /// At most so many bytes at a place, fewer at the end of the file.
    pub(crate) fn up_to(&mut self, at: u64, count: u64) -> Read<Vec<u8>> {
        self.bytes(at, count.min(self.length.saturating_sub(at)))
    }

    /// A stream of a part of the file.
    pub(crate) fn stream(&mut self, at: u64, count: u64) -> Read<io::Take<&File>> {
        self.check(at, count)?;
        let mut file = &self.file;
        file.seek(SeekFrom::Start(at))?;
        Ok(file.take(count))
    }
}

/// Exactly so many bytes of a stream; its length may be anything that the file claims, so that memory
/// grows with what there is.
pub(crate) fn exactly(stream: &mut dyn io::Read, count: u64) -> Read<Vec<u8>> {
    let mut out = Vec::new();
    stream.take(count).read_to_end(&mut out)?;
    if (out.len() as u64) < count {
        return Err(Why::from(io::Error::from(io::ErrorKind::UnexpectedEof)));
    }
    Ok(out)
}

/// Passes over bytes of a stream.
pub(crate) fn pass(stream: &mut dyn io::Read, count: u64) -> Read<()> {
    let passed = io::copy(&mut stream.take(count), &mut io::sink())?;
    if passed < count {
        return Err(Why::from(io::Error::from(io::ErrorKind::UnexpectedEof)));
    }
    Ok(())
}

/// Bytes from which fields are taken one after another.
#[derive(Clone, Debug)]
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
    /// Whether numbers have their most significant byte first.
    big: bool,
}

impl<'a> Fields<'a> {
    pub(crate) fn new(bytes: &'a [u8], big: bool) -> Self {
        Self { rest: bytes, big }
    }

    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    pub(crate) fn take(&mut self, count: usize) -> Read<&'a [u8]> {
        match self.rest.split_at_checked(count) {
            Some((taken, rest)) => {
                self.rest = rest;
                Ok(taken)
            }
            None => broken(format!(
                "a part of it ends {} bytes early",
                count - self.rest.len()
            )),
        }
    }

    pub(crate) fn skip(&mut self, count: usize) -> Read<()> {
        self.take(count).map(|_| ())
    }

    /// An unsigned number of at most 8 bytes.
    pub(crate) fn uint(&mut self, size: usize) -> Read<u64> {
        let bytes = self.take(size)?;
        let join = |value: u64, byte: &u8| (value << 8) | u64::from(*byte);
        Ok(if self.big {
            bytes.iter().fold(0, join)
        } else {
            bytes.iter().rev().fold(0, join)
        })
    }

    pub(crate) fn u8(&mut self) -> Read<u8> {
        Ok(self.uint(1)? as u8)
    }

    pub(crate) fn u16(&mut self) -> Read<u16> {
        Ok(self.uint(2)? as u16)
    }

    pub(crate) fn u32(&mut self) -> Read<u32> {
        Ok(self.uint(4)? as u32)
    }

    pub(crate) fn u64(&mut self) -> Read<u64> {
        self.uint(8)
    }

    pub(crate) fn f64(&mut self) -> Read<f64> {
        Ok(f64::from_bits(self.u64()?))
    }
}

/// The text before the first zero, or all of it, without control characters.
pub(crate) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0);
    let text = String::from_utf8_lossy(&bytes[..end.unwrap_or(bytes.len())]);
    let shown = |c: char| {
        if c.is_control() {
            char::REPLACEMENT_CHARACTER
        } else {
            c
        }
    };
    text.chars().map(shown).collect()
}
