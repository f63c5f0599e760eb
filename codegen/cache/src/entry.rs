//! The form of an entry: the name of the form, the key, a digest of key and contents, the contents.

use regen_codegen::store::Key;
use sha2::{Digest, Sha256};

/// The first bytes of an entry; another form gets another number.
const HEAD: &[u8; 16] = b"regen-cache 1   ";
const DIGEST: usize = 32;

fn digest(key: &Key, contents: &[u8]) -> [u8; DIGEST] {
    let digest = Sha256::new().chain_update(key.bytes());
    digest.chain_update(contents).finalize().into()
}

/// The file of an entry.
pub(crate) fn seal(key: &Key, contents: &[u8]) -> Vec<u8> {
    [&HEAD[..], key.bytes(), &digest(key, contents)[..], contents].concat()
}

/// The contents of a file; `None` unless it is a whole entry for this key.
pub(crate) fn open(mut file: Vec<u8>, key: &Key) -> Option<Vec<u8>> {
    let rest = file.strip_prefix(HEAD)?.strip_prefix(key.bytes())?;
    let (stated, contents) = rest.split_at_checked(DIGEST)?;
    if stated != digest(key, contents) {
        return None;
    }
    let start = file.len() - contents.len();
    file.drain(..start);
    Some(file)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn only_whole_entries_of_the_key_are_opened() {
        let (key, other) = (Key::new("a", &[b"x"]), Key::new("a", &[b"y"]));
        let file = seal(&key, b"contents");
        assert_eq!(open(file.clone(), &key).unwrap(), b"contents");
        assert_eq!(open(file.clone(), &other), None);
        for end in 0..file.len() {
            assert_eq!(open(file[..end].to_vec(), &key), None, "cut at {end}");
        }
        for place in 0..file.len() {
            let mut damaged = file.clone();
            damaged[place] ^= 0x10;
            assert_eq!(open(damaged, &key), None, "damaged at {place}");
        }
        let longer = [&file[..], b"!"].concat();
        assert_eq!(open(longer, &key), None);
    }
}
