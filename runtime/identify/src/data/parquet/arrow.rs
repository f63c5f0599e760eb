//! What Arrow says of the fields of a Parquet file: metadata such as `unit`, in a schema that its writers keep
//! beside that of the file, as a FlatBuffer in base 64.

/// The key of the file's metadata at which the schema is.
pub(super) const KEY: &str = "ARROW:schema";
/// The largest number of fields that are looked at.
const MAX_FIELDS: usize = 10_000;
/// The greatest depth of fields within fields.
const MAX_DEPTH: usize = 32;

/// A key and its value in the metadata of a field.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Said {
    /// The names of the field and of those around it, with points between them.
    pub(super) field: String,
    pub(super) key: String,
    pub(super) value: String,
}

/// The metadata of all fields; nothing of a text that is no such schema.
///
/// The layout is that of Arrow's `Message.fbs` and `Schema.fbs`.
pub(super) fn said(schema: &str) -> Vec<Said> {
    let mut out = Vec::new();
    if let Some(bytes) = decoded(schema) {
        // -1 before the length is missing in the first versions
        let skipped = if bytes.starts_with(&[0xff; 4]) { 8 } else { 4 };
        let _ = schema_of(bytes.get(skipped..).unwrap_or_default(), &mut out);
    }
    out
}

/// The bytes of a text in base 64.
fn decoded(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| -> Option<u32> {
        Some(u32::from(match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        }))
    };
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    for four in text.trim_end_matches('=').as_bytes().chunks(4) {
        let mut all = 0;
        for place in 0..4 {
            all = all << 6 | four.get(place).map_or(Some(0), |byte| digit(*byte))?;
        }
        let [_, bytes @ ..] = all.to_be_bytes();
        out.extend(bytes.get(..four.len() - 1)?);
    }
    Some(out)
}

/// A table of a FlatBuffer.
#[derive(Clone, Copy)]
struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    let own = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(own.try_into().ok()?))
}

/// Where an offset points to.
fn followed(bytes: &[u8], at: usize) -> Option<usize> {
    at.checked_add(number(bytes, at)? as usize)
}

impl Table<'_> {
    /// The place of a field; `None` where it has its default value.
    fn field(self, k: usize) -> Option<usize> {
        let back = number(self.bytes, self.at)?.cast_signed();
        let list = self
            .at
            .checked_add_signed((-i64::from(back)).try_into().ok()?)?;
        let short = |at: usize| -> Option<usize> {
            let own = self.bytes.get(at..at.checked_add(2)?)?;
            Some(usize::from(u16::from_le_bytes(own.try_into().ok()?)))
        };
        let place = list.checked_add(4 + 2 * k)?;
        if place >= list.checked_add(short(list)?)? {
            return None;
        }
        let offset = short(place).filter(|offset| *offset > 0)?;
        self.at.checked_add(offset)
    }

    fn table(self, k: usize) -> Option<Self> {
        let at = followed(self.bytes, self.field(k)?)?;
        Some(Self { at, ..self })
    }

    fn text(self, k: usize) -> Option<String> {
        let at = followed(self.bytes, self.field(k)?)?;
        let from = at.checked_add(4)?;
        let end = from.checked_add(number(self.bytes, at)? as usize)?;
        Some(String::from_utf8_lossy(self.bytes.get(from..end)?).into_owned())
    }

    /// The tables of a list.
    fn tables(self, k: usize) -> impl Iterator<Item = Self> {
        let list = self.field(k).and_then(|at| followed(self.bytes, at));
        let count = list.and_then(|at| number(self.bytes, at)).unwrap_or(0) as usize;
        let place = move |k: usize| list?.checked_add(4)?.checked_add(k.checked_mul(4)?);
        (0..count).map_while(move |k| {
            let at = followed(self.bytes, place(k)?)?;
            Some(Self { at, ..self })
        })
    }
}

fn schema_of(bytes: &[u8], out: &mut Vec<Said>) -> Option<()> {
    let message = Table {
        bytes,
        at: followed(bytes, 0)?,
    };
    let mut left = MAX_FIELDS;
    for field in message.table(2)?.tables(1) {
        add(field, "", MAX_DEPTH, &mut left, out);
    }
    Some(())
}

/// Adds what is said of a field and of those within it.
fn add(field: Table<'_>, around: &str, depth: usize, left: &mut usize, out: &mut Vec<Said>) {
    if *left == 0 || depth == 0 {
        return;
    }
    *left -= 1;
    let name = field.text(0).unwrap_or_default();
    let path = if around.is_empty() {
        name
    } else {
        format!("{around}.{name}")
    };
    let mut say = |key: String, value: String| {
        let field = path.clone();
        out.push(Said { field, key, value });
    };
    for pair in field.tables(6) {
        if *left == 0 {
            return;
        }
        *left -= 1;
        if let (Some(key), Some(value)) = (pair.text(0), pair.text(1)) {
            say(key, value);
        }
    }
    let byte = |at: Option<usize>| field.bytes.get(at?).copied();
    // the type of spans of time; milliseconds are the default, which is not stored
    if byte(field.field(2)) == Some(18)
        && let Some(kind) = field.table(3)
        && let Some(unit) =
            ["s", "ms", "us", "ns"].get(usize::from(byte(kind.field(0)).unwrap_or(1)))
    {
        say("unit".to_owned(), (*unit).to_owned());
    }
    for child in field.tables(5) {
        add(child, &path, depth - 1, left, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As pyarrow 26 writes it.
    const WRITTEN: &str = "/////2gBAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAMAAADUAAAARAAAABQAAAAQABQACAAGAAcADAAAABAAEAAAAAAAAQMQAAAAGAAAAAQAAAAAAAAABgAAAHRhdV9xMQAAGv///wAAAgCG////AAABAxQAAABoAAAACAAAABAAAAAAAAAAAgAAAHExAAACAAAAKAAAAAQAAAB4////EAAAAAQAAAACAAAANTAAAAYAAABvZGRpdHkAAJj///8QAAAABAAAAAMAAABkZWcABAAAAHVuaXQAAAYABgAEAAYAAAACABIAGAAIAAYABwAMAAAAEAAUABIAAAAAAAEDFAAAAEwAAAAIAAAAEAAAAAAAAAABAAAAdAAAAAEAAAAMAAAACAAMAAQACAAIAAAAEAAAAAQAAAABAAAAcwAAAAQAAAB1bml0AAAGAAgABgAGAAAAAAACAAAAAAA=";

    #[test]
    fn metadata_of_fields_is_that_of_the_schema_which_another_library_wrote() {
        let all = said(WRITTEN);
        let told = all
            .iter()
            .map(|own| format!("{} {}={}", own.field, own.key, own.value));
        assert_eq!(
            told.collect::<Vec<_>>(),
            ["t unit=s", "q1 unit=deg", "q1 oddity=50"]
        );
    }

    #[test]
    fn a_schema_with_any_byte_changed_or_cut_off_is_read_without_a_panic() {
        for k in 0..WRITTEN.len() {
            assert!(said(&WRITTEN[..k]).len() <= 3);
            for digit in ['A', '/', '7'] {
                let mut own = WRITTEN.to_owned();
                own.replace_range(k..=k, &digit.to_string());
                let _ = said(&own);
            }
        }
    }
}
