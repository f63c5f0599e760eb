//! `regen FILE`, the main job: derives, summarises, writes the source and verifies it.

use std::collections::BTreeMap;
use std::time::Instant;

use regen_report::results::{self, BaseSummary, Info};
use regen_sources::{State, compare_modules, generated_beside, module, place};
use regen_verify::print::{self, CheckJson};
use serde::Serialize;

use crate::args::{Format, ModelArgs};
use crate::exit::Failure;
use crate::generate;
use crate::verify;
use crate::{load, table, terminal};

#[derive(Serialize)]
struct Summary<'a> {
    #[serde(flatten)]
    info: Info<'a>,
    base: Option<BaseSummary>,
    source: String,
    states: usize,
    checks: Vec<CheckJson>,
}

/// Runs the command.
pub(crate) fn run(args: &ModelArgs) -> Result<(), Failure> {
    let Some(file) = &args.file else {
        return Err(Failure::Input("no spec was named".to_owned()));
    };
    let start = Instant::now();
    let robot = load::source_robot(file, false)?;
    let module = module(&robot, file)?;
    terminal::note(&format!(
        "derived {} in {:.2} s",
        file.display(),
        start.elapsed().as_secs_f64()
    ));

    let dir = args.out.clone().unwrap_or_else(|| generated_beside(file));
    let source = place(&dir, &robot.name)?;
    let lines = module.text.lines().count();
    let entries = compare_modules(BTreeMap::from([(robot.name.clone(), module)]), &dir, false)?;
    let mut is_current = true;
    for entry in &entries {
        generate::put(entry)?;
        is_current &= entry.is_current()?;
    }
    let changed = entries.iter().any(|entry| entry.state != State::Current);

    let verified = verify::checked(&robot, Some(is_current))?;
    terminal::print(&match args.format {
        Format::Human => format!(
            "{}{}\n{} {} ({lines} lines)\n\n{}",
            results::info_text(&robot),
            robot
                .analysis
                .as_ref()
                .map_or_else(String::new, results::base_lines),
            if changed { "wrote" } else { "up to date:" },
            source.display(),
            print::identities_text(&verified)
        ),
        Format::Json => table::document(&Summary {
            info: results::info(&robot),
            base: robot.analysis.as_ref().map(results::base_summary),
            source: source.display().to_string(),
            states: verified.states,
            checks: print::checks(&verified),
        }),
    })?;
    let failed: Vec<&str> = verified.failed().collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(verify::not_verified(&robot.name, &failed))
    }
}
