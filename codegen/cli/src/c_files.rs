//! `regen generate --target c`: a header and a source for each robot.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use regen_codegen::emit::c::{self, Files};
use regen_codegen::robot::Robot;

use crate::exit::Failure;
use crate::generate::{self, Entry};
use crate::modules::BANNER;

/// A robot's files with the names that they give to the linker.
#[derive(Debug)]
pub(crate) struct CFiles {
    files: Files,
    symbols: Vec<String>,
}

/// The files of a robot, each with the banner of generated files.
pub(crate) fn files(robot: &Robot, spec: &Path) -> Result<CFiles, Failure> {
    if c::hides_a_header(&robot.name) {
        return Err(Failure::Input(format!(
            "{}: a robot named `{}` cannot have a header of that name, which is one of the C \
             library's",
            spec.display(),
            robot.name
        )));
    }
    let file = spec.file_name().unwrap_or_default().to_string_lossy();
    let mut files = c::files(robot);
    let banner = format!("{BANNER}{file}; edit that file and run `regen generate --target c`.\n");
    files.header.insert_str(0, &banner);
    files.source.insert_str(0, &banner);
    Ok(CFiles {
        files,
        symbols: c::symbols(robot),
    })
}

/// Compares the files of the directory with those of these robots. `whole`: no files of other robots
/// belong there.
pub(crate) fn compare(
    robots: BTreeMap<String, CFiles>,
    dir: &Path,
    whole: bool,
) -> Result<Vec<Entry>, Failure> {
    let mut owners: BTreeMap<String, String> = BTreeMap::new();
    let mut names = BTreeSet::new();
    let mut entries = Vec::new();
    for (robot, CFiles { files, symbols }) in robots {
        for symbol in symbols {
            if let Some(other) = owners.insert(symbol.clone(), robot.clone()) {
                return Err(Failure::Input(format!(
                    "the robots `{other}` and `{robot}` would both have a `{symbol}` in C; give one \
                     of them another name"
                )));
            }
        }
        for (extension, text) in [("h", files.header), ("c", files.source)] {
            let path = dir.join(format!("{}.{extension}", files.name));
            entries.push(generate::entry(path, text)?);
        }
        names.insert(files.name);
    }
    if whole {
        entries.extend(generate::stale(dir, &["c", "h"], &names)?);
    }
    entries.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(entries)
}
