//! `regen FILE`, the main job: derives, summarises, writes the source and verifies it.

use std::collections::BTreeMap;
use std::time::Instant;

use serde::Serialize;

use crate::args::{Format, ModelArgs};
use crate::exit::Failure;
use crate::generate::{self, State};
use crate::info;
use crate::verify::{self, CheckJson};
use crate::{base, load, modules, sources, table, terminal, workspace};

#[derive(Serialize)]
struct Summary<'a> {
    #[serde(flatten)]
    info: info::Info<'a>,
    base: Option<base::Summary>,
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
    let robot = load::robot(file)?;
    let module = modules::module(&robot, file)?;
    terminal::note(&format!(
        "derived {} in {:.2} s",
        file.display(),
        start.elapsed().as_secs_f64()
    ));

    let dir = args
        .out
        .clone()
        .unwrap_or_else(|| workspace::generated_beside(file));
    let source = sources::place(&dir, &robot.name)?;
    let lines = module.text.lines().count();
    let entries = generate::compare(BTreeMap::from([(robot.name.clone(), module)]), &dir, false)?;
    let mut same = true;
    for entry in &entries {
        entry.write()?;
        same &= entry.is_current()?;
    }
    let changed = entries.iter().any(|entry| entry.state != State::Current);

    let verified = verify::checked(&robot, Some(same))?;
    terminal::print(&match args.format {
        Format::Human => format!(
            "{}{}\n{} {} ({lines} lines)\n\n{}",
            info::to_text(&robot),
            robot
                .analysis
                .as_ref()
                .map_or_else(String::new, base::lines),
            if changed { "wrote" } else { "up to date:" },
            source.display(),
            verify::identities(&verified)
        ),
        Format::Json => table::json(&Summary {
            info: info::info(&robot),
            base: robot.analysis.as_ref().map(base::summary),
            source: source.display().to_string(),
            states: verified.states,
            checks: verify::check_json(&verified),
        }),
    })?;
    let failed: Vec<&str> = verified.failed().collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(verify::not_verified(&robot.name, &failed))
    }
}
