//! Decompresses pages within the size that their headers claim.

use std::io::Read;

use parquet::basic::Compression;

/// Bytes of a number before a block of Hadoop's LZ4.
const WORD: usize = 4;

/// The bytes of a page.
///
/// - `size`: the number of decompressed bytes that the page claims, and at most gives.
pub(super) fn decompressed(
    codec: Compression,
    bytes: &[u8],
    size: usize,
) -> Result<Vec<u8>, String> {
    let wrong = |name: &str, why: &dyn core::fmt::Display| format!("{name}: {why}");
    let out = match codec {
        Compression::UNCOMPRESSED => bytes.to_vec(),
        Compression::SNAPPY => {
            let mut out = vec![0; size];
            let read = snap::raw::Decoder::new().decompress(bytes, &mut out);
            out.truncate(read.map_err(|e| wrong("Snappy", &e))?);
            out
        }
        Compression::GZIP(_) => {
            up_to(size, flate2::read::MultiGzDecoder::new(bytes)).map_err(|e| wrong("gzip", &e))?
        }
        Compression::BROTLI(_) => up_to(size, brotli_decompressor::Decompressor::new(bytes, 4096))
            .map_err(|e| wrong("Brotli", &e))?,
        Compression::ZSTD(_) => zstd(bytes, size).map_err(|e| wrong("zstd", &e))?,
        Compression::LZ4_RAW => lz4(bytes, size).map_err(|e| wrong("LZ4", &e))?,
        // the same name stands for three formats of different writers
        Compression::LZ4 => hadoop(bytes, size)
            .or_else(|| up_to(size, lz4_flex::frame::FrameDecoder::new(bytes)).ok())
            .map_or_else(|| lz4(bytes, size), Ok)
            .map_err(|e| wrong("LZ4", &e))?,
        Compression::LZO => {
            return Err(
                "its compression LZO is not read: save the file with zstd or Snappy".to_owned(),
            );
        }
    };
    if out.len() == size {
        Ok(out)
    } else {
        Err(format!(
            "a page does not have the {size} bytes when decompressed that it claims"
        ))
    }
}

/// All that a decoder gives, but at most one byte more than `size`.
fn up_to(size: usize, decoder: impl Read) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    decoder.take(size as u64 + 1).read_to_end(&mut out)?;
    Ok(out)
}

fn zstd(mut bytes: &[u8], size: usize) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    // several frames may follow each other
    while !bytes.is_empty() && out.len() <= size {
        let decoder = ruzstd::decoding::StreamingDecoder::new(&mut bytes);
        let decoder = decoder.map_err(|e| e.to_string())?;
        out.extend(up_to(size - out.len(), decoder).map_err(|e| e.to_string())?);
    }
    Ok(out)
}

fn lz4(bytes: &[u8], size: usize) -> Result<Vec<u8>, lz4_flex::block::DecompressError> {
    let mut out = vec![0; size];
    let length = lz4_flex::block::decompress_into(bytes, &mut out)?;
    out.truncate(length);
    Ok(out)
}

/// Blocks as Hadoop writes them, each behind its lengths; `None` for other formats.
fn hadoop(mut bytes: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    while !bytes.is_empty() {
        let mut word = || {
            let (word, rest) = bytes.split_first_chunk::<WORD>()?;
            bytes = rest;
            usize::try_from(u32::from_be_bytes(*word)).ok()
        };
        let (length, packed) = (word()?, word()?);
        let (block, rest) = bytes.split_at_checked(packed)?;
        bytes = rest;
        if length > size - out.len() {
            return None;
        }
        out.extend(lz4(block, length).ok().filter(|b| b.len() == length)?);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_expands_beyond_its_claim_is_refused_without_its_memory() {
        // 10 MB of zeros in blocks of zstd that repeat a byte
        let mut zeros = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x58];
        for k in 0..80 {
            let head: u32 = u32::from(k == 79) | 1 << 1 | (1 << 17) << 3;
            zeros.extend_from_slice(&head.to_le_bytes()[..3]);
            zeros.push(0);
        }
        let codec = Compression::ZSTD(parquet::basic::ZstdLevel::default());
        let whole = 80 << 17;
        assert_eq!(
            decompressed(codec, &zeros, whole).map(|out| out.len()),
            Ok(whole)
        );
        for size in [0, 1000, whole - 1, whole + 1] {
            let error = decompressed(codec, &zeros, size).unwrap_err();
            assert!(error.contains("that it claims"), "{error}");
        }
    }

    #[test]
    fn bytes_of_no_format_are_an_error_of_each() {
        let noise: Vec<u8> = (0..200_u32).map(|k| (k * k % 251) as u8 ^ 0xa5).collect();
        for codec in [
            Compression::SNAPPY,
            Compression::GZIP(parquet::basic::GzipLevel::default()),
            Compression::BROTLI(parquet::basic::BrotliLevel::default()),
            Compression::ZSTD(parquet::basic::ZstdLevel::default()),
            Compression::LZ4,
            Compression::LZ4_RAW,
            Compression::LZO,
        ] {
            assert!(decompressed(codec, &noise, 1000).is_err(), "{codec:?}");
        }
    }

    #[test]
    fn the_three_formats_called_lz4_are_read() {
        // a block of 5 literal bytes
        let block = *b"\x50hello";
        let framed = [&[0, 0, 0, 5, 0, 0, 0, 6][..], &block].concat();
        for bytes in [&block[..], &framed, &framed.repeat(2)] {
            let size = if bytes.len() > framed.len() { 10 } else { 5 };
            let out = decompressed(Compression::LZ4, bytes, size).unwrap();
            assert_eq!(out, b"hello".repeat(size / 5));
        }
    }
}
