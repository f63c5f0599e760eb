//! Makes a digest of the generator's sources, by which results of another version of them are told
//! apart where derived robots are stored.

use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

fn main() -> io::Result<()> {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = Vec::new();
    for input in ["Cargo.toml", "build.rs", "src"] {
        println!("cargo::rerun-if-changed={input}");
        list(&package.join(input), &mut files)?;
    }
    files.sort();
    let mut digest = Digest::new();
    for file in &files {
        let name = file.strip_prefix(&package).unwrap_or(file);
        for part in name {
            digest.add(part.as_encoded_bytes());
        }
        digest.add(&fs::read(file)?);
    }
    println!("cargo::rustc-env=REGEN_SOURCES={:032x}", digest.0);
    Ok(())
}

/// Adds the files at a path and below it.
fn list(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if !path.is_dir() {
        files.push(path.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(path)? {
        list(&entry?.path(), files)?;
    }
    Ok(())
}

/// FNV-1a of 128 bits: nobody makes collisions on purpose here, and it needs no crate.
struct Digest(u128);

impl Digest {
    fn new() -> Self {
        Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d)
    }

    /// Adds bytes and their number, so that other cuts of the same bytes give another digest.
    fn add(&mut self, bytes: &[u8]) {
        let length = (bytes.len() as u64).to_le_bytes();
        for byte in bytes.iter().chain(&length) {
            self.0 ^= u128::from(*byte);
            self.0 = self
                .0
                .wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b);
        }
    }
}
