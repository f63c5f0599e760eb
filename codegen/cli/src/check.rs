//! `regen check`: explains a mechanism in words.

use regen_report::results;

use crate::args::{CheckArgs, Format};
use crate::exit::Failure;
use crate::progress::spinner;
use crate::{load, table, terminal};

/// Runs the command.
pub(crate) fn run(args: &CheckArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mechanism = load::mechanism(&source)?;
    load::check_parameter_count(&mechanism)?;
    let working = spinner(format!("looking at how {} moves", source.name));
    let explanation = mechanism.explanation();
    working.finish_and_clear();
    let explanation = explanation?;
    terminal::print(&match args.format {
        Format::Human => results::explanation_text(&explanation),
        Format::Json => table::document(&results::explanation(&explanation)),
    })
}
