//! The keys of stored results.

use std::any::TypeId;
use std::fmt;
use std::hash::{Hash, Hasher};

use sha2::{Digest, Sha256};

use crate::robot::Robot;
use crate::sym::Number;

/// The key of a stored result: a digest (SHA-256) of everything that the result depends on,
/// including the generator.
///
/// ```
/// use regen_codegen::store::Key;
///
/// let key = Key::new("module", &[b"name: arm", b"::regen_runtime"]);
/// assert_eq!(key, Key::new("module", &[b"name: arm", b"::regen_runtime"]));
/// // the boundary between the inputs counts
/// assert_ne!(key, Key::new("module", &[b"name: arm::", b"regen_runtime"]));
/// assert_eq!(key.to_string().len(), 64);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key([u8; 32]);

impl Key {
    /// The key of a result of the given kind that this generator derives from `inputs`.
    pub fn new(kind: &str, inputs: &[&[u8]]) -> Self {
        let mut digest = Sha256::new();
        let own: [&[u8]; 4] = [
            env!("CARGO_PKG_VERSION").as_bytes(),
            env!("REGEN_SOURCES").as_bytes(),
            &build().to_le_bytes(),
            kind.as_bytes(),
        ];
        for part in own.iter().chain(inputs) {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        Self(digest.finalize().into())
    }

    /// The digest.
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

/// In hexadecimal digits.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// A number that changes with everything but the sources that this crate is built from: the
/// compiler, the features, and the versions of its dependencies. The compiler derives type
/// identifiers from these.
fn build() -> u64 {
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    TypeId::of::<Robot>().hash(&mut hash);
    TypeId::of::<Number>().hash(&mut hash);
    TypeId::of::<dashu_int::UBig>().hash(&mut hash);
    TypeId::of::<dashu_ratio::RBig>().hash(&mut hash);
    hash.finish()
}

/// FNV-1a: the standard library's hash may differ from version to version.
struct Fnv(u64);

impl Hasher for Fnv {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
