//! Reads numbers and strings in CDR, the encoding of DDS, in its first version (XCDR1).

/// The length of the encapsulation header in front of the data, in bytes: two identify the encoding,
/// two hold options.
const ENCAPSULATION: usize = 4;
/// The largest number of bytes that pad the data to a multiple of four.
const MAX_PADDING: usize = 3;

/// A reader at a position in the data of a message.
pub(crate) struct Cdr<'a> {
    data: &'a [u8],
    /// The position in `data`; alignment counts from its start.
    at: usize,
    /// Whether numbers have their most significant byte first.
    big: bool,
}

impl<'a> Cdr<'a> {
    /// A reader at the start of the data, after the encapsulation header.
    pub(crate) fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let (head, data) = bytes
            .split_at_checked(ENCAPSULATION)
            .ok_or_else(|| format!("it has {} bytes, too few for CDR", bytes.len()))?;
        let big = match head {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            [a, b, ..] => {
                return Err(format!(
                    "its encoding {a:#04x} {b:#04x} is not plain CDR of version 1"
                ));
            }
            _ => return Err("it has no encapsulation header".to_owned()),
        };
        Ok(Self { data, at: 0, big })
    }

    /// The number of bytes that have not been read.
    pub(crate) fn remaining(&self) -> usize {
        self.data.len() - self.at
    }

    /// Returns an error if more than padding has not been read.
    pub(crate) fn finish(&self) -> Result<(), String> {
        match self.remaining() {
            0..=MAX_PADDING => Ok(()),
            more => Err(format!(
                "{more} bytes follow its last field: it does not match its definition"
            )),
        }
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count);
        let found = end.and_then(|end| self.data.get(self.at..end));
        let found = found.ok_or_else(|| {
            format!(
                "it ends at byte {} of its data, although {count} more bytes are needed",
                self.data.len()
            )
        })?;
        self.at += count;
        Ok(found)
    }

    /// Reads the bytes of a number, at the next multiple of its size. Returns them with the least
    /// significant byte first.
    pub(crate) fn primitive<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let padding = (N - self.at % N) % N;
        self.bytes(padding)?;
        let mut out = [0; N];
        for (to, from) in out.iter_mut().zip(self.bytes(N)?) {
            *to = *from;
        }
        if self.big {
            out.reverse();
        }
        Ok(out)
    }

    /// Reads the number of elements of a sequence. Each element takes at least one byte, so that a
    /// number beyond the remaining bytes is an error; otherwise it could cause a huge allocation.
    pub(crate) fn count(&mut self) -> Result<usize, String> {
        let count = u32::from_le_bytes(self.primitive()?);
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        if count > self.remaining() {
            return Err(format!(
                "at byte {} of its data it claims a list of {count}, and {} bytes are left",
                self.at,
                self.remaining()
            ));
        }
        Ok(count)
    }

    /// Reads a `string`: UTF-8 with a zero byte at the end.
    pub(crate) fn text(&mut self) -> Result<String, String> {
        let count = self.count()?;
        let bytes = self.bytes(count)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        let text = core::str::from_utf8(bytes);
        let at = self.at;
        text.map(str::to_owned)
            .map_err(|_| format!("the text that ends at byte {at} of its data is not UTF-8"))
    }

    /// Reads a `wstring`: UTF-16 without a zero at the end.
    pub(crate) fn wide_text(&mut self) -> Result<String, String> {
        let count = self.count()?;
        let units: Result<Vec<u16>, String> = (0..count)
            .map(|_| self.primitive().map(u16::from_le_bytes))
            .collect();
        Ok(String::from_utf16_lossy(&units?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size_in_both_orders() {
        let little = [0, 1, 0, 0, 7, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 9, 9, 1, 0];
        let mut cdr = Cdr::new(&little).unwrap();
        assert_eq!(cdr.primitive::<1>().unwrap(), [7]);
        assert_eq!(cdr.text().unwrap(), "a");
        assert!(cdr.primitive::<4>().unwrap_err().contains("ends"));
        let big = [
            0, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0x3f, 0xf0, 0, 0, 0, 0, 0, 0,
        ];
        let mut cdr = Cdr::new(&big).unwrap();
        assert_eq!(u16::from_le_bytes(cdr.primitive().unwrap()), 5);
        assert_eq!(cdr.primitive().unwrap(), 1.0_f64.to_le_bytes());
        assert_eq!(cdr.finish(), Ok(()));
    }

    #[test]
    fn malformed_cdr_is_an_error() {
        assert!(Cdr::new(&[0, 1, 0]).is_err());
        let error = Cdr::new(&[0, 3, 0, 0]).err().unwrap();
        assert!(error.contains("0x00 0x03"), "{error}");
        let mut long = Cdr::new(&[0, 1, 0, 0, 255, 255, 255, 255]).unwrap();
        assert!(long.count().unwrap_err().contains("a list of 4294967295"));
        assert!(
            Cdr::new(&[0, 1, 0, 0, 1, 1, 1, 1])
                .unwrap()
                .finish()
                .is_err()
        );
    }
}
