//! Decompression within bounds.

use std::io::Read;

/// The largest number of bytes of a chunk or message that are held in memory.
pub(crate) const MAX_BYTES: u64 = 1 << 28;
/// First bytes of a frame of zstd.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Whether bytes are a frame of zstd; no message in CDR begins so.
pub(crate) fn is_zstd(bytes: &[u8]) -> bool {
    bytes.starts_with(&ZSTD)
}

/// Decompresses frames of zstd, at most `limit + 1` bytes: one more than allowed, so that the
/// caller notices when there are too many.
pub(crate) fn zstd(mut bytes: &[u8], limit: u64) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    while !bytes.is_empty() && out.len() as u64 <= limit {
        let mut decoder = ruzstd::decoding::StreamingDecoder::new(&mut bytes)
            .map_err(|e| format!("zstd: {e}"))?;
        let allowed = limit + 1 - out.len() as u64;
        let read = decoder.by_ref().take(allowed).read_to_end(&mut out);
        read.map_err(|e| format!("zstd: {e}"))?;
    }
    Ok(out)
}

/// Decompresses a frame of LZ4, at most `limit + 1` bytes, as [`zstd`].
fn lz4(bytes: &[u8], limit: u64) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    let decoder = lz4_flex::frame::FrameDecoder::new(bytes);
    let read = decoder.take(limit + 1).read_to_end(&mut out);
    read.map_err(|e| format!("lz4: {e}"))?;
    Ok(out)
}

/// The records of a chunk.
///
/// - `kind`: the name of the compression, empty for none;
/// - `size`: the number of bytes that the chunk claims.
pub(crate) fn records(kind: &str, bytes: &[u8], size: u64) -> Result<Vec<u8>, String> {
    if size > MAX_BYTES {
        return Err(format!(
            "it claims {size} bytes when decompressed; the limit is {MAX_BYTES}"
        ));
    }
    let out = match kind {
        "" => bytes.to_vec(),
        "zstd" => zstd(bytes, size)?,
        "lz4" => lz4(bytes, size)?,
        other => {
            let shown: String = other.chars().take(20).collect();
            return Err(format!(
                "its compression `{shown}` is neither zstd nor lz4: \
                 `mcap compress` writes a file with one of these"
            ));
        }
    };
    if out.len() as u64 == size {
        Ok(out)
    } else {
        Err(format!("it does not have the {size} bytes that it claims"))
    }
}
