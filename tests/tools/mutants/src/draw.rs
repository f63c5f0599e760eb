//! A reproducible draw.

use std::path::Path;

use crate::{TextResult, read};

/// Prints the drawn mutants, each with its number, in the order of the draw.
pub fn draw(list: &Path, seed: &str, count: &str) -> TextResult<()> {
    let mut all = read(list)?;
    let seed: u64 = seed.parse().map_err(|e| format!("seed: {e}"))?;
    let count: usize = count.parse().map_err(|e| format!("count: {e}"))?;
    let mut state = 0x9E37_79B9_7F4A_7C15 ^ seed;
    let mut next = move || {
        // xorshift64*, Vigna 2016
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33
    };
    let total = all.len();
    for i in 0..count.min(total) {
        let left = (total - i) as u64;
        all.swap(i, i + (next() % left) as usize);
    }
    all.truncate(count);
    for (number, mutant) in all.iter_mut().enumerate() {
        mutant["number"] = (number + 1).into();
    }
    eprintln!("{} of {total}", all.len());
    let text = serde_json::to_string_pretty(&all).map_err(|e| e.to_string())?;
    println!("{text}");
    Ok(())
}
