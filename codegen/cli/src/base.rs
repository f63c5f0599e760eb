//! `regen base`: the base parameters and their certificate.

use regen_codegen::Mechanism;
use regen_codegen::base::{Analysis, store};
use regen_codegen::explain::Grouped;
use regen_codegen::explain::table::{Style, Table, doubt};
use regen_report::results;

use crate::args::{BaseArgs, TableFormat};
use crate::exit::Failure;
use crate::{load, table, terminal, write};

/// Runs the command.
pub(crate) fn run(args: &BaseArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mechanism = load::mechanism(&source)?;
    load::note_units(&source);
    let analysis = load::analysis(&mechanism, &source)?;
    // only the robot's names are needed: no function is derived
    let robot = mechanism.robot(&[])?;
    if args.store {
        let beside = args.file.with_extension("base");
        write::atomically(&beside, &store(&source, analysis))?;
        terminal::note(&format!("{}: written", beside.display()));
    }
    let style = match (args.numbers, args.expressions) {
        (true, _) => Style::Numbers,
        (_, true) => Style::Expressions,
        _ => Style::Short,
    };
    let reasons = reasons(&mechanism, analysis)?;
    let table =
        Table::new(&robot, analysis, style, &reasons).with_remedy("--expressions prints it");
    terminal::print(&match args.format {
        TableFormat::Human => table.plain_text(),
        TableFormat::Markdown => table.markdown(),
        TableFormat::Latex => table.latex(),
        TableFormat::Csv => table.csv(),
        TableFormat::Json => table::json(&results::base(&robot, analysis, &reasons)),
    })?;
    match doubt(analysis) {
        Some(why) => Err(Failure::Check(format!(
            "the base parameters of {} are INCOMPLETE: {why}",
            robot.name
        ))),
        None => Ok(()),
    }
}

/// The reasons why the parameters of completed directions act only together; empty where no
/// direction was completed.
fn reasons(mechanism: &Mechanism, analysis: &Analysis) -> Result<Vec<Grouped>, Failure> {
    if analysis.base.completed == 0 {
        return Ok(Vec::new());
    }
    Ok(mechanism.explanation()?.grouped_from_samples())
}
