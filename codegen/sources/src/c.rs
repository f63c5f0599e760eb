//! The C files of a directory: a header and a source for each robot.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use regen_codegen::emit::c::{self, Files};
use regen_codegen::robot::Robot;

use crate::entry::{Entry, entry, stale};
use crate::error::SourceError;
use crate::module::banner;

/// A robot's C files, and the symbols that they export to the linker.
#[derive(Debug)]
pub struct CFiles {
    files: Files,
    casadi: Option<String>,
    symbols: Vec<String>,
}

/// Generates the files of a robot, each with the banner of generated files.
///
/// # Errors
///
/// If the robot's header would hide a header of the C library.
pub fn c_files(robot: &Robot, spec: &Path) -> Result<CFiles, SourceError> {
    if c::hides_a_header(&robot.name) {
        return Err(SourceError::HeaderName {
            spec: spec.to_owned(),
            robot: robot.name.clone(),
        });
    }
    let mut files = c::files(robot);
    let banner = banner(spec, "regen generate --target c");
    files.header.insert_str(0, &banner);
    files.source.insert_str(0, &banner);
    Ok(CFiles {
        files,
        casadi: None,
        symbols: c::symbols(robot),
    })
}

/// As [`c_files`], with a file of functions for `casadi.external`.
///
/// # Errors
///
/// As [`c_files`], and if the robot has adjustable geometry.
pub fn casadi_files(robot: &Robot, spec: &Path) -> Result<CFiles, SourceError> {
    if !robot.adjustable.is_empty() {
        return Err(SourceError::Adjustable {
            spec: spec.to_owned(),
        });
    }
    let mut files = c_files(robot, spec)?;
    let banner = banner(spec, "regen generate --target casadi");
    files.casadi = Some(banner + &c::casadi(robot));
    files.symbols.extend(c::casadi_symbols(robot));
    Ok(files)
}

/// Compares the files in the directory with the generated ones of these robots. A missing directory
/// counts as empty. With `whole`, generated files of other robots count as stale.
///
/// # Errors
///
/// If a file cannot be read, a file of the same name was not written by regen, or two robots export
/// the same symbol.
pub fn compare_c(
    robots: BTreeMap<String, CFiles>,
    dir: &Path,
    whole: bool,
) -> Result<Vec<Entry>, SourceError> {
    let mut owners: BTreeMap<String, String> = BTreeMap::new();
    let mut names = BTreeSet::new();
    let mut entries = Vec::new();
    for (robot, own) in robots {
        let CFiles {
            files,
            casadi,
            symbols,
        } = own;
        for symbol in symbols {
            if let Some(other) = owners.insert(symbol.clone(), robot.clone()) {
                return Err(SourceError::SameSymbol {
                    first: other,
                    second: robot,
                    symbol,
                });
            }
        }
        for (extension, text) in [("h", files.header), ("c", files.source)] {
            let path = dir.join(format!("{}.{extension}", files.name));
            entries.push(entry(path, text)?);
        }
        let further = format!("{}_casadi", files.name);
        if let Some(text) = casadi {
            entries.push(entry(dir.join(format!("{further}.c")), text)?);
        }
        // also where this call does not write it
        names.insert(further);
        names.insert(files.name);
    }
    if whole {
        entries.extend(stale(dir, &["c", "h"], &names)?);
    }
    entries.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(entries)
}
