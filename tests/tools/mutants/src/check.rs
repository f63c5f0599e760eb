//! Finds out which of the planted faults compile, and builds the tests as far as they do.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::programs::build;
use crate::{TextResult, read};

/// Marks the mutants in the list that the compiler rejects; the copy must then be made and planted
/// again.
pub fn check(copy: &Path, drawn: &Path, crates: &[&str]) -> TextResult<()> {
    let output = build(copy, crates)?;
    let mut rejected = BTreeSet::new();
    let mut others = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(message) = serde_json::from_str::<Value>(line) else {
            continue;
        };
        let message = &message["message"];
        if message["level"] != "error" {
            continue;
        }
        let empty = Vec::new();
        let spans = message["spans"].as_array().unwrap_or(&empty);
        let mut here = BTreeSet::new();
        for span in spans.iter().filter(|s| s["is_primary"] == true) {
            // within a macro the place is that of its call, or of the call around that
            let mut span = span;
            while span.is_object() {
                for text in span["text"].as_array().unwrap_or(&empty) {
                    here.extend(numbers(text["text"].as_str().unwrap_or_default()));
                }
                span = &span["expansion"]["span"];
            }
        }
        if here.is_empty() && !spans.is_empty() {
            others.push(message["rendered"].as_str().unwrap_or_default().to_owned());
        }
        rejected.extend(here);
    }
    let mut list = read(drawn)?;
    for mutant in &mut list {
        if mutant["number"]
            .as_u64()
            .is_some_and(|n| rejected.contains(&n))
        {
            mutant["unviable"] = true.into();
        }
    }
    let text = serde_json::to_string_pretty(&list).map_err(|e| e.to_string())?;
    fs::write(drawn, text).map_err(|e| e.to_string())?;
    println!("do not compile: {rejected:?}");
    if rejected.is_empty() && !output.status.success() {
        return Err(format!("errors elsewhere:\n{}", others.join("\n")));
    }
    Ok(())
}

/// The numbers of the faults on a line of source.
fn numbers(line: &str) -> impl Iterator<Item = u64> + '_ {
    line.split("switch_of_faults::on(")
        .skip(1)
        .filter_map(|rest| rest.split(')').next()?.parse().ok())
}
