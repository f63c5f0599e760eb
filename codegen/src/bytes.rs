//! Serialises numbers, texts and lists to bytes, and reads them back.

/// Writes values one after the other.
#[derive(Debug, Default)]
pub(crate) struct Writer(Vec<u8>);

impl Writer {
    /// The bytes that were written.
    pub(crate) fn finish(self) -> Vec<u8> {
        self.0
    }

    /// A byte, such as the tag of an enum's variant.
    pub(crate) fn byte(&mut self, value: u8) {
        self.0.push(value);
    }

    /// An unsigned integer with seven bits per byte (LEB128), so that small numbers are short.
    pub(crate) fn integer(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    /// An index or a length.
    pub(crate) fn size(&mut self, value: usize) {
        self.integer(value as u64);
    }

    /// A signed integer.
    pub(crate) fn signed(&mut self, value: i64) {
        self.0.extend(value.to_le_bytes());
    }

    /// All bits of a double.
    pub(crate) fn double(&mut self, value: f64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(crate) fn flag(&mut self, value: bool) {
        self.byte(u8::from(value));
    }

    /// Bytes after their number.
    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.size(bytes.len());
        self.0.extend(bytes);
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    /// The number of elements, then each of them.
    pub(crate) fn list<T>(&mut self, list: &[T], mut write: impl FnMut(&mut Self, &T)) {
        self.size(list.len());
        for element in list {
            write(self, element);
        }
    }
}

/// Reads what a [`Writer`] wrote; every method returns `None` if the bytes are malformed.
#[derive(Debug)]
pub(crate) struct Reader<'b>(&'b [u8]);

impl<'b> Reader<'b> {
    pub(crate) fn new(bytes: &'b [u8]) -> Self {
        Self(bytes)
    }

    /// Whether all bytes were read.
    pub(crate) fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }

    fn take(&mut self, count: usize) -> Option<&'b [u8]> {
        let (head, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(head)
    }

    pub(crate) fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    pub(crate) fn integer(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    pub(crate) fn size(&mut self) -> Option<usize> {
        usize::try_from(self.integer()?).ok()
    }

    pub(crate) fn signed(&mut self) -> Option<i64> {
        Some(i64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    pub(crate) fn double(&mut self) -> Option<f64> {
        Some(f64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    pub(crate) fn flag(&mut self) -> Option<bool> {
        match self.byte()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }

    pub(crate) fn bytes(&mut self) -> Option<&'b [u8]> {
        let count = self.size()?;
        self.take(count)
    }

    pub(crate) fn text(&mut self) -> Option<String> {
        String::from_utf8(self.bytes()?.to_owned()).ok()
    }

    pub(crate) fn list<T>(
        &mut self,
        mut read: impl FnMut(&mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
        let count = self.size()?;
        // every element takes at least a byte: this bounds the memory that a wrong count reserves
        let mut list = Vec::with_capacity(count.min(self.0.len()));
        for _ in 0..count {
            list.push(read(self)?);
        }
        Some(list)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn what_is_written_is_read_to_the_last_byte() {
        let integers = [0, 1, 127, 128, 300, u64::MAX];
        let mut out = Writer::default();
        out.list(&integers, |out, x| out.integer(*x));
        out.double(-0.0);
        out.signed(-5);
        out.text("s1.1");
        out.flag(true);
        let bytes = out.finish();
        let mut reader = Reader::new(&bytes);
        assert_eq!(reader.list(Reader::integer).unwrap(), integers);
        assert_eq!(reader.double().unwrap().to_bits(), (-0.0_f64).to_bits());
        assert_eq!(reader.signed(), Some(-5));
        assert_eq!(reader.text().as_deref(), Some("s1.1"));
        assert!(!reader.is_at_end());
        assert_eq!(reader.flag(), Some(true));
        assert!(reader.is_at_end());
        assert_eq!(reader.byte(), None);
    }

    #[test]
    fn a_list_longer_than_the_bytes_is_refused() {
        let mut out = Writer::default();
        out.integer(u64::MAX);
        let bytes = out.finish();
        assert_eq!(Reader::new(&bytes).list(Reader::byte), None);
        assert_eq!(Reader::new(&[0xff; 20]).integer(), None);
    }
}
