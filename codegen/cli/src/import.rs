//! `regen import`: converts URDF, SDF, MJCF and USD files to specs.

use std::fs;

use regen_codegen::diag::{Report, Source};
use regen_import::{Imported, LOOP_IN_TREE, OptionNames, Options};
use serde::Serialize;

use crate::args::{Base, Format, ImportArgs};
use crate::exit::Failure;
use crate::{load, table, terminal, write};

/// The JSON of `regen import`.
#[derive(Serialize)]
struct ImportJson<'a> {
    robot: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<String>,
    spec: &'a str,
    notes: Vec<NoteJson<'a>>,
}

#[derive(Serialize)]
struct NoteJson<'a> {
    file: &'a str,
    line: usize,
    column: usize,
    text: &'a str,
}

/// Runs the command.
pub(crate) fn run(args: &ImportArgs) -> Result<(), Failure> {
    let source = load::file(&args.file)?;
    let mut reader = load::included_files(&args.file);
    let options = Options {
        name: args.name.clone(),
        exact: args.exact,
        geared: args.geared,
        base: args.base.map(|base| match base {
            Base::Fixed => regen_import::Base::Fixed,
            Base::Floating => regen_import::Base::Floating,
        }),
        lock: args.lock.clone(),
        cuts: args.cuts.clone(),
        actuated: args.actuated.clone(),
        home: args.home.clone(),
        ignore: args.ignore.clone(),
        names: OptionNames {
            cuts: "--cut",
            actuated: "--actuated",
            home: "--home",
            lock: "--lock",
            base: "--base",
            geared: "--geared",
            ignore: "--ignore",
        },
    };
    let mut imported = regen_import::import(&source, &mut reader, &options)
        .map_err(|reports| Failure::Spec(advised(reports)))?;
    if args.geared {
        let plain = Options {
            geared: false,
            ..options
        };
        let plain = regen_import::import(&source, &mut reader, &plain);
        if plain.is_ok_and(|plain| plain.spec == imported.spec) {
            let text = "--geared has no effect here: the file states friction and rotors of all joints with \
                        motors, or has no such joint";
            return Err(Failure::Usage(text.to_owned()));
        }
    }
    for note in &mut imported.notes {
        if note.changes_digits {
            note.text.push_str("; --exact keeps the digits");
        }
        terminal::note(&format!("note: {note}"));
    }
    load::note_units(&Source {
        name: source.name.clone(),
        text: imported.spec.clone(),
    });
    if let Some(out) = &args.out {
        // A pipe or a device has no content that could be overwritten.
        let is_file = fs::metadata(out).map_or(true, |found| found.is_file());
        if args.force || !is_file {
            write::atomically(out, &imported.spec)?;
        } else {
            let remedy = "choose another file, or replace it with --force";
            write::create(out, &imported.spec, remedy)?;
        }
    }
    match (args.format, &args.out) {
        (Format::Json, out) => {
            let written = out.as_ref().map(|out| out.display().to_string());
            terminal::print(&json(&imported, written))
        }
        (Format::Human, None) => terminal::print(&imported.spec),
        (Format::Human, Some(out)) => terminal::print(&format!("wrote {}\n", out.display())),
    }
}

/// Appends to hints on loops in the tree the option that helps, `--cut`.
fn advised(mut reports: Vec<Report>) -> Vec<Report> {
    for diagnostic in reports.iter_mut().flat_map(|r| &mut r.diagnostics) {
        if diagnostic.kind == Some(LOOP_IN_TREE)
            && let Some(hint) = &mut diagnostic.hint
        {
            hint.push_str(" (--cut)");
        }
    }
    reports
}

fn json(imported: &Imported, written: Option<String>) -> String {
    let notes = imported.notes.iter().map(|note| NoteJson {
        file: &note.file,
        line: note.line,
        column: note.column,
        text: &note.text,
    });
    table::document(&ImportJson {
        robot: &imported.name,
        written,
        spec: &imported.spec,
        notes: notes.collect(),
    })
}
