//! `regen new`: writes a commented spec to begin with.

use std::path::PathBuf;

use regen_codegen::diag::Source;
use regen_import::{Rows, from_dh_table};
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
    /// The text of the spec, in which `NAME` and `FILE` are to be replaced.
    fn template(self) -> &'static str {
        match self {
            Self::Serial => include_str!("new/serial.yaml"),
            Self::Planar => include_str!("new/planar.yaml"),
            Self::Parallel => include_str!("new/parallel.yaml"),
            Self::Drives => include_str!("new/drives.yaml"),
            Self::Delta => include_str!("new/delta.yaml"),
            Self::Stewart => include_str!("new/stewart.yaml"),
        }
    }
}

/// Runs `regen new`.
pub(crate) fn run(args: &NewArgs) -> Result<(), Failure> {
    // the file's name is as good as the robot's
    let name = args.name.strip_suffix(".yaml").unwrap_or(&args.name);
    // other characters, such as a line break, could end the value of `name` in the YAML
    let plain = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    if !name.chars().all(plain) {
        return Err(Failure::Input(format!(
            "{name:?} is not a name for a module: lower-case letters, digits and _, such as my_arm"
        )));
    }
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{name}.yaml")));
    let text = match (&args.from_dh, args.kind) {
        (Some(table), _) => {
            let rows = if args.classic {
                Rows::Classic
            } else {
                Rows::Modified
            };
            from_dh_table(&load::source(table)?, name, rows)
                .map_err(|report| Failure::Spec(vec![report]))?
        }
        (None, kind) => kind
            .unwrap_or(Kind::Serial)
            .template()
            .replace("NAME", name)
            .replace("FILE", &out.display().to_string()),
    };
    // templates and tables are valid by now, so only the name can be wrong: reading the spec checks
    // it
    let own = Source {
        name: out.display().to_string(),
        text: text.clone(),
    };
    load::derived(&own)?;
    load::note_units(&own);
    let remedy = "choose another NAME, or a file with --out";
    write::create(&out, &text, remedy)?;
    let written = out.display().to_string();
    match args.format {
        Format::Json => terminal::print(&table::document(&Printed {
            robot: name,
            written,
        })),
        Format::Human => terminal::print(&format!(
            "wrote {written}\nIt works as it stands: regen check {written}\nThen make it yours, line by line.\n"
        )),
    }
}
