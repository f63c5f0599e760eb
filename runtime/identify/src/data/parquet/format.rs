//! The type of each field of the format's structures (`parquet.thrift` of the specification).
//!
//! The library reads each known field with the type of the specification, even if the file states
//! another one, and then continues at a wrong position. The checks here can predict what the
//! library reads only where both types agree.

/// An outermost structure of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Root {
    /// The file's metadata.
    Footer,
    /// The header of a page.
    Page,
}

/// Type codes of Thrift's compact protocol.
const BOOLEAN: u8 = 1;
pub(super) const BYTE: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
pub(super) const LIST: u8 = 9;
pub(super) const STRUCTURE: u8 = 12;

impl Root {
    /// The type of the field at `path` (field numbers from the outermost structure inwards), and
    /// of its elements if it is a list; `None` for fields that the format does not have.
    #[allow(clippy::match_same_arms, reason = "in the order of the format")]
    fn kind(self, path: &[i64]) -> Option<(u8, u8)> {
        let list = |of: u8| Some((LIST, of));
        let plain = |kind: u8| Some((kind, 0));
        match (self, path) {
            (Self::Footer, [1]) => plain(I32),
            (Self::Footer, [2 | 4 | 5 | 7] | [4, 1 | 4] | [4, 1, 3, 8 | 13]) => list(STRUCTURE),
            (Self::Footer, [3]) => plain(I64),
            // key and value; creator and signing key
            (Self::Footer, [6 | 9] | [5, 1 | 2] | [4, 1, 3, 8, 1 | 2]) => plain(BINARY),
            (Self::Footer, [8] | [7 | 8, _]) => plain(STRUCTURE),
            // schema elements, and their logical types
            (Self::Footer, [2, 4]) => plain(BINARY),
            (Self::Footer, [2, 1..=9]) => plain(I32),
            (Self::Footer, [2, 10] | [2, 10, _] | [2, 10, 7 | 8, 2] | [2, 10, 7 | 8, 2, _]) => {
                plain(STRUCTURE)
            }
            (Self::Footer, [2, 10, 5, 1 | 2] | [2, 10, 18, 2]) => plain(I32),
            (Self::Footer, [2, 10, 7 | 8, 1] | [2, 10, 10, 2]) => plain(BOOLEAN),
            (Self::Footer, [2, 10, 10 | 16, 1]) => plain(BYTE),
            (Self::Footer, [2, 10, 17 | 18, 1]) => plain(BINARY),
            // row groups, and their order
            (Self::Footer, [4, 2 | 3 | 5 | 6]) => plain(I64),
            (Self::Footer, [4, 7]) => plain(I16),
            (Self::Footer, [4, 4, 1]) => plain(I32),
            (Self::Footer, [4, 4, 2 | 3]) => plain(BOOLEAN),
            // columns
            (Self::Footer, [4, 1, 1 | 9]) => plain(BINARY),
            (Self::Footer, [4, 1, 2 | 4 | 6]) => plain(I64),
            (Self::Footer, [4, 1, 5 | 7]) => plain(I32),
            (Self::Footer, [4, 1, 3 | 8] | [4, 1, 8, _]) => plain(STRUCTURE),
            (Self::Footer, [4, 1, 8, 2, 1]) => list(BINARY),
            (Self::Footer, [4, 1, 8, 2, 2]) => plain(BINARY),
            // statistics of a column
            (Self::Footer, [4, 1, 3, 1 | 4 | 15] | [4, 1, 3, 13, 1..=3]) => plain(I32),
            (Self::Footer, [4, 1, 3, 5..=7 | 9..=11 | 14] | [4, 1, 3, 16, 1]) => plain(I64),
            (Self::Footer, [4, 1, 3, 2] | [4, 1, 3, 17, 2]) => list(I32),
            (Self::Footer, [4, 1, 3, 3]) => list(BINARY),
            (Self::Footer, [4, 1, 3, 16, 2 | 3]) => list(I64),
            (Self::Footer, [4, 1, 3, 12 | 16 | 17] | [4, 1, 3, 17, 1]) => plain(STRUCTURE),
            (Self::Footer, [4, 1, 3, 17, 1, 1..=8]) => plain(DOUBLE),
            (Self::Footer, [4, 1, 3, 12, field]) => statistics(*field),
            (Self::Page, [1..=4] | [5, 1..=4] | [7, 1 | 2] | [8, 1..=6]) => plain(I32),
            (Self::Page, [5..=8] | [5, 5] | [8, 8]) => plain(STRUCTURE),
            (Self::Page, [7, 3] | [8, 7]) => plain(BOOLEAN),
            (Self::Page, [5, 5, field] | [8, 8, field]) => statistics(*field),
            _ => None,
        }
    }

    /// Whether `found` is the type of the field at `path` in the specification; true for unknown
    /// fields.
    pub(super) fn fits(self, path: &[i64], found: u8) -> bool {
        self.kind(path)
            .is_none_or(|(kind, _)| kind == found || (kind == BOOLEAN && found == 2))
    }

    /// Whether `found` is the type of the elements of the list at `path` in the specification;
    /// true for unknown fields.
    pub(super) fn fits_elements(self, path: &[i64], found: u8) -> bool {
        self.kind(path).is_none_or(|(_, of)| of == found)
    }
}

fn statistics(field: i64) -> Option<(u8, u8)> {
    match field {
        1 | 2 | 5 | 6 => Some((BINARY, 0)),
        3 | 4 => Some((I64, 0)),
        7 | 8 => Some((BOOLEAN, 0)),
        _ => None,
    }
}
