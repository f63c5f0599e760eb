//! `regen new`: a commented spec to begin with.

use std::fs::OpenOptions;
use std::path::PathBuf;

use regen_codegen::diag::Source;
use serde::Serialize;

use crate::args::{Format, Kind, NewArgs};
use crate::exit::Failure;
use crate::{load, table, terminal, write};

/// The JSON of `regen new`.
#[derive(Serialize)]
struct Printed<'a> {
    robot: &'a str,
    written: String,
}

impl Kind {
    fn template(self) -> &'static str {
        match self {
            Self::Serial => include_str!("new/serial.yaml"),
            Self::Planar => include_str!("new/planar.yaml"),
            Self::Parallel => include_str!("new/parallel.yaml"),
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &NewArgs) -> Result<(), Failure> {
    // Anything else could end the line that it is written into.
    let plain = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    if !args.name.chars().all(plain) {
        return Err(Failure::Input(format!(
            "{:?} is no name for a module: lower-case letters, digits and _, such as my_arm",
            args.name
        )));
    }
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.yaml", args.name)));
    let text = args
        .kind
        .template()
        .replace("NAME", &args.name)
        .replace("FILE", &out.display().to_string());
    // The name is all that can still be wrong: what is said about it is what the spec's reader says.
    load::derived(&Source {
        name: out.display().to_string(),
        text: text.clone(),
    })?;
    if let Some(dir) = out.parent().filter(|dir| !dir.as_os_str().is_empty()) {
        std::fs::create_dir_all(dir).map_err(|error| Failure::io("create", dir, &error))?;
    }
    // Reserved, so that a file of the same name is never replaced, not even one made just now.
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&out)
        .map_err(|error| match error.kind() {
            std::io::ErrorKind::AlreadyExists => Failure::Io(format!(
                "{} exists already and is left as it is: choose another NAME, or a file with --out",
                out.display()
            )),
            _ => Failure::io("write", &out, &error),
        })?;
    if let Err(failure) = write::atomically(&out, &text) {
        // It is empty, and ours.
        let _ = std::fs::remove_file(&out);
        return Err(failure);
    }
    let written = out.display().to_string();
    match args.format {
        Format::Json => terminal::print(&table::json(&Printed {
            robot: &args.name,
            written,
        })),
        Format::Human => terminal::print(&format!(
            "wrote {written}\nIt works as it stands: regen check {written}\nThen make it yours, line by line.\n"
        )),
    }
}
