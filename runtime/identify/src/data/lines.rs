//! Reads the lines of a file through a buffer.

use std::io::{self, Read};

/// Bytes that are read at a time; a line that is longer makes the buffer grow.
const BUFFER: usize = 1 << 16;

/// Bytes that a row may have: thousands of columns. A file without ends of line would fill the memory.
const MAX_ROW: usize = 1 << 20;

fn too_long(from: u64) -> io::Error {
    let why = format!("the row at line {from} has more than {MAX_ROW} bytes, the limit");
    io::Error::new(io::ErrorKind::InvalidData, why)
}

/// An input that fails within a row that is too long.
#[derive(Debug)]
pub(super) struct Limited<R> {
    input: R,
    left: usize,
    line: u64,
}

impl<R> Limited<R> {
    pub(super) fn new(input: R) -> Self {
        Self {
            input,
            left: MAX_ROW,
            line: 1,
        }
    }

    /// Allows another row, which begins at a line.
    pub(super) fn renew(&mut self, line: u64) {
        self.left = MAX_ROW;
        self.line = line;
    }
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(too_long(self.line));
        }
        let room = out.len().min(self.left);
        let count = self.input.read(&mut out[..room])?;
        self.left -= count;
        Ok(count)
    }
}

/// A place in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// The number of bytes before it.
    pub(super) byte: u64,
    /// The line, from 1.
    pub(super) line: u64,
}

/// The lines of an input, each without the line feed at its end.
#[derive(Debug)]
pub(super) struct Lines<R> {
    input: R,
    buffer: Vec<u8>,
    /// The bytes of the buffer that are read and not yet passed on.
    start: usize,
    end: usize,
    /// The place of the next line.
    place: Place,
    ended: bool,
}

impl<R: Read> Lines<R> {
    /// The lines of what `input` still has, whose first byte is at `place`.
    pub(super) fn new(input: R, place: Place) -> Self {
        Self {
            input,
            buffer: vec![0; BUFFER],
            start: 0,
            end: 0,
            place,
            ended: false,
        }
    }

    /// The place of the next line.
    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// The next line with the place behind it; `None` at the end. A line feed at the very end begins
    /// no further line.
    pub(super) fn next_line(&mut self) -> io::Result<Option<(&[u8], Place)>> {
        let mut searched = self.start;
        loop {
            let rest = self.buffer.get(searched..self.end).unwrap_or_default();
            if let Some(length) = memchr::memchr(b'\n', rest) {
                let line = self.start..searched + length;
                self.start = line.end + 1;
                self.place.byte += (line.len() + 1) as u64;
                self.place.line += 1;
                let place = self.place;
                return Ok(self.buffer.get(line).map(|line| (line, place)));
            }
            if self.ended {
                let line = self.start..self.end;
                self.start = self.end;
                self.place.byte += line.len() as u64;
                let line = self.buffer.get(line).unwrap_or_default();
                return Ok((!line.is_empty()).then_some((line, self.place)));
            }
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
            searched = self.end;
            if self.end >= MAX_ROW {
                return Err(too_long(self.place.line));
            }
            if self.end == self.buffer.len() {
                self.buffer.resize(2 * self.end, 0);
            }
            let space = self.buffer.get_mut(self.end..).unwrap_or_default();
            match self.input.read(space) {
                Ok(0) => self.ended = true,
                Ok(count) => self.end += count,
                Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
                Err(why) => return Err(why),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An input that gives few bytes at a time.
    struct Drops<'a>(&'a [u8], usize);

    impl Read for Drops<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(out.len());
            let (own, rest) = self.0.split_at(count);
            out[..count].copy_from_slice(own);
            self.0 = rest;
            Ok(count)
        }
    }

    #[test]
    fn a_row_without_end_is_refused_with_its_line_before_it_is_read_whole() {
        let start = Place { byte: 5, line: 2 };
        let mut lines = Lines::new(io::Cursor::new(b"a\n").chain(io::repeat(b'7')), start);
        assert!(lines.next_line().unwrap().is_some());
        let error = lines.next_line().unwrap_err().to_string();
        assert!(
            error.starts_with("the row at line 3 has more than"),
            "{error}"
        );
        let text = b"1,2\n\"3\",".chain(io::repeat(b'7'));
        let mut rows = csv::ReaderBuilder::new()
            .has_headers(false)
            .from_reader(Limited::new(text));
        let mut row = csv::ByteRecord::new();
        assert!(rows.read_byte_record(&mut row).unwrap());
        let line = rows.position().line();
        rows.get_mut().renew(line);
        let error = rows.read_byte_record(&mut row).unwrap_err().to_string();
        assert!(error.contains("the row at line 2 has more than"), "{error}");
    }

    #[test]
    fn lines_are_those_of_the_text_however_it_arrives() {
        let long = "7".repeat(3 * BUFFER);
        for text in [
            "",
            "a",
            "a\n",
            "a\nbc",
            "\n\na\n",
            &long,
            &format!("x\n{long}\ny"),
        ] {
            for drop in [1 + text.len() / 5, BUFFER] {
                let start = Place { byte: 5, line: 2 };
                let mut lines = Lines::new(Drops(text.as_bytes(), drop), start);
                for (k, expected) in text.lines().enumerate() {
                    assert_eq!(lines.place().line, 2 + k as u64);
                    let (line, _) = lines.next_line().unwrap().unwrap();
                    assert_eq!(line, expected.as_bytes());
                }
                assert!(lines.next_line().unwrap().is_none());
                assert_eq!(lines.place().byte, 5 + text.len() as u64);
            }
        }
    }
}
