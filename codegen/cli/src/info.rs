//! `regen info`: a robot's names, sizes and operation counts.

use regen_report::results::{info, info_text};

use crate::args::{Format, InfoArgs};
use crate::exit::Failure;
use crate::{load, table, terminal};

/// Runs the command.
pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let robot = load::robot(&args.file)?;
    terminal::print(&match args.format {
        Format::Human => info_text(&robot),
        Format::Json => table::json(&info(&robot)),
    })
}
