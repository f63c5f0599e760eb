//! Makes rustdoc's text of the guide from its pages, which are written for readers of the repository
//! and of a site: links to pages become links to modules, figures are put where they are shown, and
//! examples that use `?` get the result that rustdoc needs.

use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What rustdoc does not show: an example that ends so may use `?`.
const ENDS: &str = "# Ok::<(), Box<dyn std::error::Error>>(())";

fn main() -> io::Result<()> {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    let pages = package.join("pages");
    println!("cargo::rerun-if-changed=pages");
    for entry in fs::read_dir(&pages)? {
        let path = entry?.path();
        if path.extension().is_some_and(|end| end == "md") {
            let text = for_rustdoc(&fs::read_to_string(&path)?, &pages)?;
            fs::write(out.join(path.file_name().unwrap_or_default()), text)?;
        }
    }
    Ok(())
}

fn for_rustdoc(page: &str, folder: &Path) -> io::Result<String> {
    let mut lines: Vec<String> = Vec::new();
    // in a block, whether it is an example in Rust, and whether it uses `?`
    let mut block: Option<(bool, bool)> = None;
    for line in page.lines() {
        if let Some(word) = line.strip_prefix("```") {
            if block == Some((true, true)) {
                lines.push(ENDS.to_owned());
            }
            block = block.is_none().then_some((word == "rust", false));
            lines.push(line.to_owned());
        } else if let Some((_, fails)) = &mut block {
            *fails |= [")?", "]?"].iter().any(|end| line.contains(end));
            lines.push(line.to_owned());
        } else if let Some(figure) = figure(line) {
            lines.push(fs::read_to_string(folder.join(figure))?);
        } else {
            lines.push(linked(line));
        }
    }
    Ok(lines.join("\n"))
}

/// The file of a line that shows a figure.
fn figure(line: &str) -> Option<&str> {
    let (_, rest) = line.strip_prefix("![")?.split_once("](")?;
    rest.strip_suffix(')')
}

/// A line whose links to pages name modules.
fn linked(line: &str) -> String {
    let mut parts = line.split("](");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (target, rest) = part.split_once(')').unwrap_or((part, ""));
        let (page, place) = match target.split_once('#') {
            Some((page, place)) => (page, format!("#{place}")),
            None => (target, String::new()),
        };
        let target = match page.strip_suffix(".md") {
            Some("index") => format!("crate{place}"),
            Some(name) if !page.contains('/') => {
                format!("crate::{}{place}", name.replace('-', "_"))
            }
            _ => target.to_owned(),
        };
        text.extend(["](", target.as_str(), ")", rest]);
    }
    text
}
