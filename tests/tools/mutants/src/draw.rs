//! A reproducible draw.

use std::collections::BTreeMap;
use std::path::Path;

use crate::{TextResult, read};

/// Prints the drawn mutants, each with its number, in the order of the draw: `count`, and as many
/// more as each package needs to have at least `least`.
pub fn draw(list: &Path, seed: &str, count: &str, least: &str) -> TextResult<()> {
    let mut all = read(list)?;
    let seed: u64 = seed.parse().map_err(|e| format!("seed: {e}"))?;
    let count: usize = count.parse().map_err(|e| format!("count: {e}"))?;
    let least: usize = least.parse().map_err(|e| format!("least: {e}"))?;
    let mut state = 0x9E37_79B9_7F4A_7C15 ^ seed;
    let mut next = move || {
        // xorshift64*, Vigna 2016
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33
    };
    let total = all.len();
    for i in 0..total {
        let left = (total - i) as u64;
        all.swap(i, i + (next() % left) as usize);
    }
    let mut of_package: BTreeMap<String, usize> = BTreeMap::new();
    let mut drawn = Vec::new();
    for (place, mut mutant) in all.into_iter().enumerate() {
        let package = mutant["package"].as_str().unwrap_or_default();
        let here = of_package.entry(package.to_owned()).or_default();
        if place < count || *here < least {
            *here += 1;
            mutant["number"] = (drawn.len() + 1).into();
            drawn.push(mutant);
        }
    }
    eprintln!("{} of {total}: {of_package:?}", drawn.len());
    let text = serde_json::to_string_pretty(&drawn).map_err(|e| e.to_string())?;
    println!("{text}");
    Ok(())
}
